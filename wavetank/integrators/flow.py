"""The flow dq/dt = H_p, dp/dt = -H_q at one point: one evaluation of a system that remembers it."""

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem


def flow(system: HamiltonianSystem, q: Vector, p: Vector, t: float) -> tuple[Vector, Vector]:
    """Return (dq/dt, dp/dt) at one point."""
    return system.H_p(q, p, t), -system.H_q(q, p, t)
