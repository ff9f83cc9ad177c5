"""Planning of a case: required resolution, numerics that reach an accuracy at least cost, predicted error and cost.

``plan.py`` combines the fully discrete dispersion relation (``dispersion.py``), the requirements of the case
(``requirements.py``), the predicted error (``resolution.py``) and the cost (``cost.py``). ``default_plan.py`` replaces
an accuracy by planned numerics, ``report.py`` prints the plan, ``checks.py`` yields the warnings.
"""
