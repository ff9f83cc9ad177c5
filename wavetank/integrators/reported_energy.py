"""The energy of what a scheme reports, from the point at which its next step begins."""

from wavetank.hamiltonian.change import change
from wavetank.hamiltonian.contract import HamiltonianSystem
from wavetank.integrators.contract import State


def reported_energy(system: HamiltonianSystem, state: State, t: float) -> float:
    """Return H at a state's (q, p), to the square of what lies between them and the last point known; collective.

    That point is evaluated, and no other.
    """
    q, p = state.known[-1]
    energy = system.energy(q, p, t)
    if q is state.q and p is state.p:
        return energy
    return energy + change(system, (q, p), (state.q, state.p), t)
