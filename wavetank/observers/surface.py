"""Snapshots of the surface along the tank, at the degrees of freedom, in the laboratory's x."""

from typing import Protocol

import numpy as np

from wavetank.arrays import Vector
from wavetank.observers.contract import Moment, ObservedWaves
from wavetank.observers.schedule import Schedule


class SurfaceRecord(Protocol):
    """Where snapshots go; only rank 0's are kept."""

    def append(self, t: float, x: Vector, eta: Vector, psi: Vector) -> None:
        """Append one snapshot."""


class SurfaceSnapshots:
    """Elevation [m] and surface potential [m²/s] against x [m].

    Parameters
    ----------
    record
        Where snapshots go, or None on the other ranks.
    """

    def __init__(self, waves: ObservedWaves, *, record: SurfaceRecord | None, schedule: Schedule):
        self._waves, self._record, self.schedule = waves, record, schedule
        reference = self._gather(waves.plane.x)
        self._order = np.argsort(reference, kind="stable")
        self._reference = reference[self._order]

    def _gather(self, owned: Vector) -> Vector:
        parts = self._waves.plane.comm.gather(owned)
        return np.concatenate(parts) if parts else np.zeros(0)

    def observe(self, moment: Moment) -> None:
        """Append one snapshot; collective."""
        eta = self._gather(self._waves.elevation(moment.q, moment.p, moment.t))
        psi = self._gather(moment.p)
        if self._record is not None:
            x = self._waves.wall.to_physical(np.column_stack([self._reference, np.zeros_like(self._reference)]))[:, 0]
            self._record.append(moment.t, x, eta[self._order], psi[self._order])
