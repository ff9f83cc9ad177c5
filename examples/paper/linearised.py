"""The flow linearised about a state of the water: frequencies and growth rates of small disturbances.

    dz/dt = A z,   A = (H_pq  H_pp; -H_qq  -H_qp),   z = (Q, psi) scaled to metres

The current of a steep wave shifts the frequency of short waves by current times wave number.
"""

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.tank.still_water import scales
from wavetank.tank.waves import NonlinearWaves

DIFFERENCE = 1e-5  # m; of the surface, for directional derivatives of the flow


class LinearisedFlow:
    """A as an operator, by central differences of the flow; collective throughout.

    Parameters
    ----------
    q, p, t
        The state.
    """

    def __init__(self, waves: NonlinearWaves, q: Vector, p: Vector, t: float):
        self._waves, self._t, self._scale = waves, t, np.concatenate(scales(waves))
        self._state = np.concatenate([q, p])

    def _flow(self, state: Vector) -> Vector:
        q, p = np.split(state, 2)
        return self._waves.evaluate(q, p, self._t).flow.ravel()

    def __call__(self, z: Vector) -> Vector:
        """Return A z, shape (2 owned,)."""
        largest = float(np.abs(z).max(initial=0.0))
        size = DIFFERENCE / max(self._waves.plane.comm.allreduce(largest, op=MPI.MAX), 1e-300)
        step = size * self._scale * z
        return np.asarray((self._flow(self._state + step) - self._flow(self._state - step)) / (2 * size) / self._scale)

    def matrix(self) -> Vector:
        """Return A as a dense matrix, on one rank: for small tanks only."""
        return np.array([self(unit) for unit in np.eye(self._state.size)]).T
