"""The potential of a state and its rate of change, which pressure and acceleration are made of.

The potential phi below a surface makes K + W stationary: A phi + w = 0 in the interior columns, with the operator A
and the wall's vector w of ``waves.py``. That holds at all times, so the rate of phi at fixed places (X, zeta) of the
reference tank solves the same problem once more (docs/method.md, section 8),

    A phi' = -(A' phi + w'),   phi' = psi' at the surface,   psi' = -H_Q,  Q' = H_psi.

A' phi + w' is how the residual of a potential that stays changes when the state goes on as it moves now: a central
difference of fourth order, of products of the operator that there is, exact to 1e-11 and the same for any wall and
bed. Waves of the observer's own do it, so that those that are stepped stay, bit for bit, what they are.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.motion.motion import Tangent
from wavetank.tank.bed import Bed
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.potential import interior_of
from wavetank.tank.walls import Placed
from wavetank.tank.waves import NonlinearWaves

PART = 2e-3  # of the water column, or of the depth a paddle goes: so far a state goes on for its rates
STENCIL = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}  # steps, and weights of a derivative of fourth order


class MovingWater(Protocol):
    """The water of a state, and how it moves: what pressure and acceleration are made of.

    Attributes
    ----------
    plane, vertical, bed, gravity
        As of the waves.
    densities
        Of the velocity, in UFL.
    h
        The column [m].
    nodes, carried
        Where the Gauss nodes zeta of the columns are in the laboratory, along x, y and z [m], and how fast they move
        [m/s]; at all degrees of freedom that this rank sees, shape (levels, rows, 3).
    phi, phi_rate
        The potential [m²/s] and its rate [m²/s²] at fixed places (X, zeta), but for their levels.
    level, level_rate
        What is left out of them.
    """

    plane: Plane
    vertical: VerticalBasis
    bed: Bed
    gravity: float
    densities: WaterEnergy
    h: Field
    nodes: Vector
    carried: Vector
    phi: LayeredField
    phi_rate: LayeredField
    level: float
    level_rate: float

    @property
    def wall(self) -> Placed:
        """The wall, as it stands."""

    def find_rates(self, q: Vector, p: Vector, t: float) -> None:
        """Find the potential of a state and its rate; collective."""

    def head(self, velocity: Vector) -> Vector:
        """Return what velocities, shape (..., 3), add to Bernoulli's sum [m²/s²], shape (...)."""


class NonlinearRates(NonlinearWaves):
    """Nonlinear waves of an observer's own; see ``MovingWater``.

    Their wall is moved by ``tangents``, one for each of its paddles.
    """

    def __init__(self, plane: Plane, *, tangents: Sequence[Tangent], **parts: object):
        self._tangents, self._has_rates = tangents, False
        super().__init__(plane, **parts)  # type: ignore[arg-type]
        self._places, self._d = _places(plane), plane.function("depth")
        self.nodes: Vector = np.zeros((self.vertical.n + 1, len(self._places), 3))
        self.carried = self.nodes
        self.phi_rate = plane.layered_function(self.vertical.n + 1, "rate of the potential")
        self.level_rate = 0.0

    def find_rates(self, q: Vector, p: Vector, t: float) -> None:
        """See ``MovingWater``."""
        if self._has_rates and self.knows(q, p, t):
            return
        q_rate, p_rate = self.H_p(q, p, t), -self.H_q(q, p, t)
        column, step = self.h.owned.copy(), self._step(q_rate)
        residual_rate, self.carried = np.zeros_like(self.phi.owned), np.zeros_like(self.carried)
        for steps, weight in STENCIL.items():
            super()._stand(t + steps * step)
            self.h.set(self.columns.solve(q + steps * step * q_rate))
            self.operator.update()
            residual_rate += weight / step * (self.operator.apply(self.phi.rows) + self._wall_terms.vector())
            self.carried += weight / step * self._nodes()
        self._begin(q, p, t, column)
        self.nodes = self._nodes()
        self.level_rate = self.plane.sum(p_rate) / self.plane.size
        self.phi_rate.owned[:] = 0.0
        self.phi_rate.owned[:, -1] = p_rate - self.level_rate
        self.potential.minimiser.find(self.phi_rate.owned, residual_rate)
        self.phi_rate.fetch()
        self._know(self._point, t)
        self._has_rates = True

    def _nodes(self) -> Vector:
        """Return where the Gauss nodes of the columns are in the laboratory [m], as ``carried``; collective."""
        self._d.set(np.zeros(self.plane.owned) + self.bed.still)
        heights = self.vertical.zeta[:, None] * self.h.rows[:, 0] - self._d.rows[:, 0]
        return _standing(self.wall, self._places, heights)

    def _stand(self, t: float) -> None:
        """Move the wall to where its motion is touched; collective."""
        for tangent in self._tangents:
            tangent.at = t
        super()._stand(t)

    def _know(self, point: Vector, t: float) -> None:
        super()._know(point, t)
        self._has_rates = False

    def _step(self, q_rate: Vector) -> float:
        """Return for how long the state goes on [s]; collective."""
        rising = float(np.abs(self.mass.solve(q_rate) / self.h.owned).max(initial=0.0))
        going = float(np.abs(self.wall.velocities).max(initial=0.0)) / self.depth
        fastest = self.plane.comm.allreduce(max(rising, going), op=MPI.MAX)
        return float(PART / fastest) if fastest > 0.0 else 1.0

    def head(self, velocity: Vector) -> Vector:
        """See ``MovingWater``."""
        return np.asarray(0.5 * (velocity**2).sum(axis=-1))

    def _set_up_stages(self, tolerances: object) -> None:
        """Set up nothing: these waves are not stepped."""


class LinearRates:
    """The water of linear waves, which goes up to z = 0; see ``MovingWater``.

    Potential and rate are two solves of one problem: for psi and X_p', and for psi' = -g eta and X_p''.
    """

    def __init__(self, waves: LinearWaves, *, tolerance: float):
        self.plane, self.vertical, self.bed = waves.plane, waves.vertical, waves.bed
        self.wall, self.gravity, self._waves = waves.wall, waves.gravity, waves
        components = waves.vertical.n + 1
        self.h = self.plane.function("water column")
        self.h.set(np.zeros(self.plane.owned) + self.bed.still)
        heights = np.multiply.outer(self.vertical.zeta - 1.0, self.h.rows[:, 0])
        self.nodes = _standing(self.wall, _places(self.plane), heights)
        self.carried = np.zeros_like(self.nodes)
        self.phi = self.plane.layered_function(components, "potential")
        self.phi_rate = self.plane.layered_function(components, "rate of the potential")
        self.level = self.level_rate = 0.0
        g = fem.Constant(self.plane.mesh, waves.gravity)
        self.densities = WaterEnergy(h=self.h.function, d=self.bed.d, gravity=g, mapping=waves.wall.mapping)
        column = self.densities.column
        self._minimum = interior_of(column, self.plane, self.vertical, column=self.h, tolerance=tolerance).minimum
        self._minimum.factor()
        self._paddles = [(paddle.motion, waves.flux(paddle, self.densities)) for paddle in waves.wall.paddles]

    def find_rates(self, q: Vector, p: Vector, t: float) -> None:
        """See ``MovingWater``."""
        speeds, accelerations = ([motion.derivative(t, order) for motion, _ in self._paddles] for order in (1, 2))
        self.level = self._solve(self.phi, p, speeds)
        self.level_rate = self._solve(self.phi_rate, -self._waves.H_q(q, p, t), accelerations)

    def _solve(self, field: LayeredField, surface: Vector, speeds: Sequence[float]) -> float:
        """Set a field to the potential below a surface's, less its mean there, which is returned; collective."""
        level = self.plane.sum(surface) / self.plane.size
        field.owned[:] = 0.0
        field.owned[:, -1] = surface - level
        fluxes = (speed * flux for speed, (_, flux) in zip(speeds, self._paddles, strict=True))
        self._minimum.find(field.owned, sum(fluxes, start=np.zeros((1, field.owned.shape[1]))))
        field.fetch()
        return level

    def head(self, velocity: Vector) -> Vector:
        """Return nothing: it is of second order."""
        return np.zeros(velocity.shape[:-1])


def _places(plane: Plane) -> Vector:
    """Return where all degrees of freedom that this rank sees are in the reference tank [m], shape (rows, 2)."""
    return plane.chart.places(plane.V.tabulate_dof_coordinates())


def _standing(wall: Placed, places: Vector, heights: Vector) -> Vector:
    """Return where reference places are in the laboratory at heights [m], shape (levels, rows): (levels, rows, 3)."""
    levels = heights if wall.leans else heights[:1]  # an upright wall carries all of a column alike
    along = np.array([wall.to_physical(places, z) for z in levels])
    return np.concatenate([np.broadcast_to(along, (*heights.shape, 2)), heights[..., None]], axis=-1)
