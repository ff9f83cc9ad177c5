"""Comparisons and figures of run directories and measured records, independent of the solver."""
