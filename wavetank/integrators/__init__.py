"""Time integrators from a discontinuous-in-time variational principle, one scheme per file.

``INTEGRATORS`` are the schemes that a case can name; ``wavetank/base/schemes.py`` registers them.
``examples/paper`` has further schemes for comparison.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from wavetank.base.schemes import SCHEMES
from wavetank.integrators.contract import Point, Traces
from wavetank.integrators.gauss_legendre import GaussLegendre4
from wavetank.integrators.simpson import Simpson4
from wavetank.integrators.stormer_verlet import StormerVerlet, StormerVerletAdjoint
from wavetank.integrators.third_order import ThirdOrder
from wavetank.integrators.wrappers import Damped, Damping, Filtered, damped

NEEDED = (
    *("name", "order", "stability_limit", "frequency_error", "nodes", "start", "step"),
    *("solvable", "costs"),  # required by plans
)


def registered(schemes: Mapping[str, type[Any]]) -> dict[str, type[Any]]:
    """Return the integrators by their names in a case; raises ``TypeError`` if one lacks a required attribute."""
    for name, scheme in schemes.items():
        if missing := [one for one in NEEDED if not hasattr(scheme, one)]:
            raise TypeError(f"{scheme.__name__} has no {', '.join(missing)}; a case needs them (docs/extend.md).")
        if scheme.name != name:
            raise TypeError(f"{scheme.__name__}.name = {scheme.name!r}: must be {name!r}, as in SCHEMES.")
    return dict(schemes)


INTEGRATORS = registered(
    {
        name: getattr(import_module(f"wavetank.integrators.{module}"), scheme)
        for name, (module, scheme) in SCHEMES.items()
    }
)
