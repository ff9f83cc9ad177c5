"""Hamiltonian systems as an integrator sees them, and the solver of their implicit stages."""
