"""Snapshots of the surface along the tank, at the degrees of freedom, in the laboratory's x."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.fem.by_place import SAME
from wavetank.fem.in_rows import in_rows
from wavetank.fem.points import Points
from wavetank.simulation.contract import Moments, ObservedWaves, Patient
from wavetank.simulation.record import Record
from wavetank.simulation.schedule import Schedule
from wavetank.stateful import Held


class SurfaceSnapshots(Patient):
    """Elevation [m] and surface potential [m²/s] against x [m], at the places of the mesh on which the run began.

    Parameters
    ----------
    record
        Where rows go, or None on the other ranks: of each snapshot its time, and x, eta and psi at all places.
    """

    def __init__(self, waves: ObservedWaves, *, record: Record | None, schedule: Schedule):
        self._waves, self._record, self.schedule = waves, record, schedule
        self.sees = waves
        comm, reference = waves.plane.comm, self._gather(waves.plane.x)
        self._order = np.argsort(reference, kind="stable")
        self._look_at(comm.bcast(reference[self._order]))
        self._points: Points | None = None  # where those are not the places of this mesh

    def _look_at(self, x: Vector) -> None:
        """Take the places in the mesh [m] in the order of x."""
        self._reference, self._places = x, np.column_stack([x, np.zeros_like(x)])
        near = np.flatnonzero(self._waves.wall.reaches(self._places))  # and all that stand between
        self._near = slice(near[0], near[-1] + 1) if near.size else slice(0)
        self._beside = self._places[self._near]

    def _gather(self, owned: Vector) -> Vector:
        """Return what all ranks own of the last axis, on the first of them."""
        parts = self._waves.plane.comm.gather(owned)
        return np.concatenate(parts, axis=-1) if parts else owned[..., :0]

    def work_off(self, moments: Moments) -> None:
        """Append the snapshots; collective."""
        seen = moments.seen(self._waves)
        fields, which = (seen.sight.eta, seen.sight.psi), seen.rows
        if self._points is not None or self._waves.plane.comm.size > 1:
            fields, which = (self._found(seen.eta), self._found(seen.psi)), np.arange(len(moments))
        if self._record is not None:
            rows, near = in_rows(moments.times, self._reference, fields, which, self._order), self._near
            x, above, _ = rows[:, 1:].reshape(len(rows), 3, -1).swapaxes(0, 1)
            stands = moments.stands(self._waves, self._beside)
            x[:, near] = self._waves.wall.to_physical(self._beside, above[:, near], stands)[..., 0]
            self._record.extend(rows)

    def _found(self, owned: Vector) -> Vector:
        """Return values on the first rank, of those of K fields, shape (K, owned): at the places, or as gathered."""
        if self._points is None:
            return self._gather(owned)
        found = list[Vector]()
        for one in owned:
            self._field.set(one)
            found.append(self._points.evaluate(self._field))
        return np.array(found)

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
        self._points, self._order = Points(plane, plane.chart.place(self._places)), np.arange(x.size)

    carry = take
