"""Planning of a case: required resolution, cheapest numerics for an accuracy, predicted error and cost.

``plan.py`` searches numerics by the requirements of the case (``requirements.py``), the predicted error
(``prediction.py``) and the cost (``cost.py``); ``resolution.py`` has the rule for cases without a plan. ``report.py``
prints a plan, ``checks.py`` yields warnings of a case.
"""
