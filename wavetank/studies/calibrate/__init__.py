"""Calibration: the paddle motion that generates a target wave in the nonlinear tank.

``targets.py`` reads the target of a case, ``crest.py`` and ``record.py`` correct settings of the waves,
``calibration.py`` runs attempts, ``attempts.py`` defines their results, ``drawing.py`` draws them.
"""
