"""Time integrators from a discontinuous-in-time variational principle, one method a file."""

from wavetank.integrators.stormer_verlet import StormerVerlet, StormerVerletAdjoint
from wavetank.integrators.third_order import ThirdOrder

INTEGRATORS = {scheme.name: scheme for scheme in (ThirdOrder, StormerVerlet, StormerVerletAdjoint)}

__all__ = ["INTEGRATORS", "StormerVerlet", "StormerVerletAdjoint", "ThirdOrder"]
