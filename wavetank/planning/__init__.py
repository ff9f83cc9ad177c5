"""Planning of a case: required resolution, numerics that reach an accuracy at least cost, predicted error and cost.

``plan.py`` searches numerics by the requirements of the case (``requirements.py``), the predicted error
(``prediction.py``) and the cost (``cost.py``); ``resolution.py`` has the rule for cases of which no plan is made.
``report.py`` prints a plan, ``checks.py`` yields warnings of a case.
"""
