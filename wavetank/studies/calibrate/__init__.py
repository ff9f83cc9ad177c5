"""Calibration: which motion of the paddle makes a wave that is wanted of the nonlinear tank."""
