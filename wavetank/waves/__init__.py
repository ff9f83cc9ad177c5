"""Exact and independent solutions, in numpy and scipy alone; waves by the protocol of ``wave.py``."""
