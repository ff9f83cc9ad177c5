"""From a case to a run: construction of the tank, clock, time loop and diagnostics."""
