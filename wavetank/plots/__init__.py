"""What is made of a run directory afterwards: comparisons and figures; never the solver."""
