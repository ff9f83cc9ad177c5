"""The walls of a tank that can move: none, one, or two at opposite ends, with separate reaches.

The reference tank is at rest; the mapping determines the positions of its points in the laboratory, gradients and
volumes. No point is displaced by two paddles, so that displacements, terms of the Hamiltonian and power of both
add up. Without motion all of them vanish before compilation.

Beside a leaning paddle a column of water h has the mass

    Q = int v (h + a . grad(s X_p) R(h)) dX = M_J h with the mean of J over the column,     R = int f dz over it,
    dQ/dh = M_J with J at the surface.
"""

from collections.abc import Iterator
from functools import reduce
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import ConvergenceError
from wavetank.fem.mass import PRODUCTS, MassMatrix
from wavetank.fem.plane import Plane
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.paddle import Paddle
from wavetank.tank.walls.shape import UPRIGHT, Polynomial
from wavetank.tank.walls.terms import WallTerms

Heights = Vector | float  # heights of positions [m], shape (N,), at K times (K, N), or one number
MOST = 30  # largest number of iterations
ROUND_OFF = 1e-15  # round-off relative to the columns


class Wall:
    """The walls of a tank: fixed, or with one paddle; in linear waves also with two.

    Attributes
    ----------
    paddles
        The paddles, in nonlinear waves ``Paddle``, in linear waves ``LinearPaddle``.
    moves, leans
        Whether the mapping can change; whether it depends on the height.
    mapping
        Mapping from the reference tank to the laboratory.
    shifts
        s X_p along x at the degrees of freedom of this rank [m], shape (dofs,), in a permanent array, and f, for each
        moving paddle.
    displaced_dofs
        Owned degrees of freedom that the mapping displaces.
    velocities
        Velocities that identify the motion at a time [m/s], shape (owned,) or ().
    rates
        Current X_p, X_p' and X_p'' of the paddles [m, m/s, m/s²], shape (paddles, 3); nan if they vary with y.
    """

    velocities: Vector = np.zeros(())
    rates: Vector = np.zeros((0, 3))

    def __init__(self, *paddles: Any):
        self.paddles: tuple[Any, ...] = paddles
        self._moving: list[Paddle] = [paddle for paddle in paddles if paddle.moves]
        self.moves, self.leans = bool(self._moving), any(paddle.leans for paddle in self._moving)
        self.mapping = Shift()
        self.shifts: list[tuple[Vector, Polynomial]] = []
        self.displaced_dofs: NDArray[np.intp] = np.arange(0)
        for paddle in self._moving:
            self.mapping = paddle.mapping
            self.shifts.append((paddle.mesh_motion.position.rows[:, 0], paddle.shape))
            self.displaced_dofs = np.union1d(self.displaced_dofs, paddle.displaced_dofs)
        if len(self._moving) == 1:
            motion = self._moving[0].mesh_motion
            self.velocities, self.rates = motion.velocities, motion.rates[None]

    @property
    def displaced(self) -> float:
        """Largest displacement of the paddles from rest [m]."""
        return max((paddle.mesh_motion.displaced for paddle in self._moving), default=0.0)

    @property
    def nearest(self) -> Vector:
        """1 at the owned degrees of freedom nearest to each paddle, else 0, shape (paddles, owned)."""
        if len(self._moving) < 2:
            return np.ones((len(self._moving), self._moving[0].plane.owned if self._moving else 0))
        first, second = (paddle.side.distances(paddle.plane.places) for paddle in self._moving)
        return np.array([first < second, first >= second], dtype=np.float64)

    def distances(self, plane: Plane) -> Vector:
        """Return the distances of the degrees of freedom from the first paddle at rest, or x [m], shape (owned,)."""
        return self.paddles[0].side.distances(plane.places) if self.paddles else plane.x

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """Return whether paddles can displace positions [m], physical or reference ones, shape (N,)."""
        reached = [paddle.side.distances(places) < paddle.reach for paddle in self._moving]
        return np.any(reached, axis=0) if reached else np.zeros(len(places), dtype=bool)

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """Return the effect of the mapping at the surface, shape (4, owned), for an elevation and depth [m].

        Along its axis: the displacement s f X_p [m]; the velocity at fixed height, s f X_p' [m/s]; the flux of
        displaced water, s R X_p' [m²/s]; and the vertical derivative of the displacement. The shape is linearised about
        still water, which is accurate to some digits. For fixed walls the shape is (0, owned).
        """
        each = [paddle.at_surface(eta, still) for paddle in self._moving]
        return reduce(np.add, each) if each else np.zeros((0, len(eta)))

    def set_time(self, t: float) -> bool:
        """Move to the positions at t [s]; return whether the mapping has changed; collective."""
        return any([paddle.mesh_motion.set_time(t) for paddle in self._moving])

    def paddle_displacements(self, places: Vector, t: float | None = None, positions: Vector | None = None) -> Vector:
        """Return the displacements X_p of the paddles at the y of positions [m], shape (paddles, N).

        Positions are physical or reference ones. Displacements are the current ones, or those at t [s], given the
        positions [m] of rigid paddles at t, nan for others, shape (paddles,).
        """
        result = np.zeros((len(self._moving), len(places)))
        each = self.rates[:, 0] if positions is None else positions
        for row, paddle, x in zip(result, self._moving, each, strict=True):
            motion, y = paddle.mesh_motion, paddle.side.along
            row[:] = motion.positions(motion.t if t is None else t, y(places)) if isnan(x) else x
        return result

    def displacements_at(self, places: Vector, times: Vector, positions: Vector) -> Vector:
        """Return the displacements at K times [s] in m, shape (paddles, K, N), for positions of shape (K, paddles)."""
        if np.isfinite(positions).all():
            return np.repeat(positions.T[..., None], len(places), axis=-1)
        each = zip(map(float, times), positions, strict=True)
        return np.stack([self.paddle_displacements(places, t, x) for t, x in each], axis=1)

    def to_reference(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the reference positions of physical ones, (x, y) [m], shape (N, 2), at heights z [m].

        Displacements are by default the current ones. With those of K times, see ``displacements_at``, the result has
        shape (K, N, 2), or (N, 2) without moving walls.
        """
        for paddle, displacement in self._displacements(places, z, displacements):
            places = paddle.side.to_reference(places, displacement, paddle.reach)
        return places

    def to_physical(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return the physical positions of reference ones, with the same arguments."""
        for paddle, displacement in self._displacements(places, z, displacements):
            places = paddle.side.to_physical(places, displacement, paddle.reach)
        return places

    def _displacements(
        self, places: Vector, z: Heights, displacements: Vector | None
    ) -> Iterator[tuple[Paddle, Vector]]:
        """Return the moving paddles with f X_p at the y of positions [m]."""
        each = self.paddle_displacements(places) if displacements is None else displacements
        for paddle, displacement in zip(self._moving, each, strict=False):
            yield paddle, paddle.shape.at(np.asarray(z)) * displacement if paddle.leans else displacement

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return the mesh velocities at reference positions [m/s], shape (N, 2)."""
        result = np.zeros_like(places)
        for paddle in self._moving:
            speeds = paddle.blending(places) * paddle.mesh_motion.speeds(paddle.side.along(places))
            result += np.outer(speeds, paddle.side.normal)
        return result

    def columns(self, water: Any) -> "MassMatrix | LeaningColumns":
        """Return the map from masses to columns: M_J, or beside a leaning paddle Newton's method."""
        return LeaningColumns(self.mapping, water) if self.leans else water.mass

    def terms(self, water: Any) -> WallTerms:
        """Return the part of the Hamiltonian of a ``DiscreteEnergy`` that the walls add."""
        return WallTerms(self, self._moving, water)


class BothEnds(Wall):
    """Walls with two facing paddles whose reaches do not overlap, in nonlinear waves."""

    def __init__(self, first: Paddle, second: Paddle):
        super().__init__(first, second)
        self._sum = first.plane.function("s X_p of both")
        if not self.leans:
            self.shifts = [(self._sum.rows[:, 0], UPRIGHT)]
            self.mapping = Shift(first.axis, [(self._sum.function, UPRIGHT)])
        else:
            self.mapping = Shift(first.axis, [*first.mapping.parts, *second.mapping.parts])
        self._nearest = self.nearest
        self._add()

    def _add(self) -> None:
        first, second = (paddle.mesh_motion.position.rows for paddle in self._moving)
        np.add(first, second, out=self._sum.rows)

    def set_time(self, t: float) -> bool:
        """Move to the positions at t [s]; return whether the mapping has changed; collective."""
        changed = super().set_time(t)
        self._add()
        return changed

    @property
    def velocities(self) -> Vector:  # type: ignore[override]
        """See ``Wall``: velocities of the nearer paddle."""
        first, second = (paddle.mesh_motion.velocities for paddle in self._moving)
        return np.where(self._nearest[0], first, second)

    @property
    def rates(self) -> Vector:  # type: ignore[override]
        """See ``Wall``."""
        return np.array([paddle.mesh_motion.rates for paddle in self._moving])


class LeaningColumns:
    """Columns beside paddles of any shape, at the owned degrees of freedom.

    Mass matrix and columns have the same methods, ``solve`` and ``apply``.

    Newton's method uses M_J of its last update; each iteration reduces the error by about a hundred.

    Attributes
    ----------
    mean, column, trials, round_off
        As in ``fem/slice.py``.
    """

    trials, round_off = MOST, ROUND_OFF

    def __init__(self, mapping: Shift, water: Any):
        self._mass: MassMatrix = water.mass
        self._plane: Plane = water.plane
        self._start: Vector = water.h.owned
        self._h = self._plane.function("columns")
        self._h.set(self._start)
        h = self._h.function
        self.column: Vector = h.x.array
        mean = 1 + mapping.stretching(lambda shape: shape.column(h, water.bed.d)) / h
        self.mean = MassMatrix(self._plane, mean, unit=water.unit, prefix="mean", functions=PRODUCTS)

    def apply(self, h: Vector) -> Vector:
        """Return the masses of columns [m]; collective."""
        self._h.set(h)
        self.mean.update()
        return self.mean.apply(h)

    def solve(self, q: Vector) -> Vector:
        """Return the columns [m] of masses; collective. Raises ``ConvergenceError``."""
        h = self._start.copy()
        bound, last = ROUND_OFF**2 * self._square(h), 0.0
        for _ in range(MOST):
            change = self._mass.solve(q - self.apply(h))
            h += change
            square = self._square(change)
            if square <= bound or square**2 <= bound * last:  # predicted next change
                return h
            last = square
        raise ConvergenceError(f"the water columns beside the paddle did not converge in {MOST} iterations")

    def _square(self, values: Vector) -> float:
        return summed(self._plane.comm, float(values @ values))
