"""The flow dq/dt = H_p, dp/dt = -H_q at one point: one evaluation of a system that remembers it."""

from collections.abc import Callable

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.hamiltonian import HamiltonianSystem


def flow(system: HamiltonianSystem, q: Vector, p: Vector, t: float) -> tuple[Vector, Vector]:
    """Return (dq/dt, dp/dt) at one point."""
    return system.H_p(q, p, t), -system.H_q(q, p, t)


def flow_of(system: HamiltonianSystem) -> Callable[[Vector, float], Vector]:
    """Return f(z, t) = dz/dt of z = [q, p], one behind the other, shape (2n,)."""
    of_system: Callable[[Vector, float], Vector] | None = getattr(system, "flow", None)  # see ``Flowing``
    if of_system is not None:
        return of_system

    def both(z: Vector, t: float) -> Vector:
        q, p = z.reshape(2, -1)
        return np.concatenate(flow(system, q, p, t))

    return both
