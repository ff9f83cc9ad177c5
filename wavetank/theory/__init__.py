"""Exact and independent solutions, in numpy alone."""
