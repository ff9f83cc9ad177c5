"""The water: the tank's geometry, the discrete energy, the interior potential and the Hamiltonian system they make."""
