"""Snapshots of the surface along the tank, at the degrees of freedom, in the laboratory's x."""

from typing import NamedTuple, Protocol

import numpy as np

from wavetank.arrays import Vector
from wavetank.fe.by_place import SAME
from wavetank.fe.points import Points
from wavetank.observers.contract import Moment, ObservedWaves, Patient
from wavetank.observers.schedule import Schedule
from wavetank.stateful import Held


class SurfaceRecord(Protocol):
    """Where snapshots go; only rank 0's are kept."""

    def extend(self, t: Vector, x: Vector, eta: Vector, psi: Vector) -> None:
        """Append K snapshots: times [s], shape (K,), and places [m], elevations [m] and potentials [m²/s], (K, N)."""


class _Kept(NamedTuple):
    """The time [s], elevation [m] and potential [m²/s] at this rank's degrees of freedom, and how the wall stood."""

    t: float
    eta: Vector
    psi: Vector
    stand: Vector


class SurfaceSnapshots(Patient):
    """Elevation [m] and surface potential [m²/s] against x [m], at the places of the mesh on which the run began.

    Parameters
    ----------
    record
        Where snapshots go, or None on the other ranks.
    """

    def __init__(self, waves: ObservedWaves, *, record: SurfaceRecord | None, schedule: Schedule):
        self._waves, self._record, self.schedule = waves, record, schedule
        self._kept = list[_Kept]()
        comm, reference = waves.plane.comm, self._gather(waves.plane.x)
        self._order = np.argsort(reference, kind="stable")
        self._look_at(comm.bcast(reference[self._order]))
        self._points: Points | None = None  # where those are not the places of this mesh

    def _look_at(self, x: Vector) -> None:
        """Take the places in the mesh [m] in the order of x."""
        self._reference, self._places = x, np.column_stack([x, np.zeros_like(x)])

    def _gather(self, owned: Vector) -> Vector:
        if self._waves.plane.comm.size == 1:
            return owned
        parts = self._waves.plane.comm.gather(owned)
        return np.concatenate(parts) if parts else np.zeros(0)

    def keep(self, moment: Moment) -> None:
        """Keep a snapshot; collective."""
        eta, stand = moment.elevation(self._waves), self._waves.wall.stand(self._places)
        self._kept.append(_Kept(moment.t, eta, moment.p.copy(), stand))

    def work_off(self) -> None:
        """Append the snapshots; collective."""
        kept, self._kept = self._kept, []
        if not kept:
            return
        eta = np.array([self._sorted(one.eta) for one in kept])
        psi = np.array([self._sorted(one.psi) for one in kept])
        if self._record is not None:
            places, stand = np.tile(self._places, (len(kept), 1)), np.concatenate([one.stand for one in kept], axis=1)
            x = self._waves.wall.to_physical(places, eta.ravel(), stand)[:, 0]
            self._record.extend(np.array([one.t for one in kept]), x.reshape(eta.shape), eta, psi)

    def _sorted(self, owned: Vector) -> Vector:
        """Return values at the places in the order of x, on the first rank, of values at the degrees of freedom."""
        if self._points is None:
            return self._gather(owned)[self._order]
        self._field.set(owned)
        return self._points.evaluate(self._field)

    def held(self) -> Held:
        """Return the places in the mesh [m]."""
        return {"x": self._reference.tolist()}

    def take(self, held: Held) -> None:
        """Look at these places; collective."""
        plane, x = self._waves.plane, np.array(held["x"])
        if x.shape == self._reference.shape and np.allclose(x, self._reference, rtol=0.0, atol=SAME * plane.cell_size):
            return
        self._look_at(x)
        self._field = plane.function("on the surface")
        self._points = Points(plane, plane.chart.place(self._places))

    carry = take
