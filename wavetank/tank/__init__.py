"""The water: the geometry of the tank, the discrete energy, the interior potential and the Hamiltonian system."""
