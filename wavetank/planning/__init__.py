"""What a scene requires: the objects it needs, the numerics that reach an accuracy at least cost, and what they cost.

``plan.py`` puts together the fully discrete dispersion relation (``dispersion.py``), what the scene asks for
(``requirements.py``), the error to expect (``error_model.py``) and the cost (``cost_model.py``).
``planned.py`` puts the plan in the place of an accuracy, ``command.py`` shows it.
"""
