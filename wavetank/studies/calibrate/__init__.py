"""Calibration: the paddle motion that generates a target wave in the nonlinear tank.

``aims.py`` evaluates runs and corrects the waves, ``calibration.py`` runs attempts, ``drawing.py`` draws them.
"""
