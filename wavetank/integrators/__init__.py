"""Time integrators from a discontinuous-in-time variational principle, one method a file.

``INTEGRATORS`` are those that a case can name. ``examples/paper`` has further schemes for comparison.
"""

from typing import Any

from wavetank.integrators.damped import Damped, Damping, damped
from wavetank.integrators.filtered import Filtered
from wavetank.integrators.gauss_legendre import GaussLegendre4
from wavetank.integrators.simpson import Simpson4
from wavetank.integrators.states import Point, Traces
from wavetank.integrators.stormer_verlet import StormerVerlet, StormerVerletAdjoint
from wavetank.integrators.third_order import ThirdOrder

NEEDED = (
    *("name", "order", "stability_limit", "frequency_error", "nodes", "start", "step"),
    *("solvable", "costs"),  # by plans
)


def registered(*schemes: type[Any]) -> dict[str, type[Any]]:
    """Return integrators by their names in a case; raises ``TypeError`` if one lacks what a case needs of it."""
    for scheme in schemes:
        if missing := [name for name in NEEDED if not hasattr(scheme, name)]:
            raise TypeError(f"{scheme.__name__} has no {', '.join(missing)}; a case needs them (docs/extend.md).")
    return {scheme.name: scheme for scheme in schemes}


INTEGRATORS = registered(Simpson4, ThirdOrder, StormerVerlet, StormerVerletAdjoint, GaussLegendre4)
