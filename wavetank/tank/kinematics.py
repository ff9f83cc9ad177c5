"""Kinematics of the water: velocity, acceleration and pressure at points, from the interior potential.

Derivatives of finite elements jump between cells: at a degree of freedom that several cells share, the velocity is
the mean over these cells, on all ranks.

The potential phi below a surface makes K + W stationary: A phi + w = 0 in the interior columns, with the operator A
and the wall's vector w of ``waves.py``. This holds at all times, so the rate of phi at fixed positions (X, zeta) of the
reference tank solves the same problem with another right-hand side (docs/method.md, section 8),

    A phi' = -(A' phi + w'),   phi' = psi' at the surface,   psi' = -H_Q,  Q' = H_psi.

A' phi + w' is the rate of the residual at fixed phi along the motion of the state: a central difference of fourth order
of products of the operator, exact to 1e-11 and the same for any wall and bed.

Velocity, acceleration and pressure are gradients of potentials, and Bernoulli's sum. Divided by density, with phi_t
the rate of the potential at fixed points in space,

    velocity = grad phi,   local acceleration = grad phi_t,   pressure = -(B + g z),   B = phi_t + 1/2 |grad phi|^2,

and the acceleration of a particle is grad B, since the flow is irrotational. With the rate phi' at positions of the
reference tank, which move with the velocity c,

    phi_t = phi' - c . grad phi.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy
import ufl
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed
from wavetank.fem.forms import compile_expression
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.points import Points
from wavetank.fem.vertical import VerticalBasis
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.motion.motion import Tangent
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.evaluation import WaterEvaluation
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.potential import interior_of
from wavetank.tank.walls import Wall
from wavetank.tank.walls.mesh_motion import MeshMotion
from wavetank.tank.waves import HistoryState, NonlinearWaves

HEIGHTS = 64  # number of heights whose vertical modes are stored


class Velocity:
    """Velocity and potential at heights zeta for the last evaluated state of the waves.

    With u = sum_j P_j(zeta) phi_j and w = sum_j P_j'(zeta) phi_j the velocity is (docs/method.md, section 1)

        (grad u - (zeta grad h - grad d) w / h,  w / h),

    compiled once for all heights: zeta, P_j(zeta) and P_j'(zeta) are constants of the compiled expression.

    Parameters
    ----------
    potential
        Another potential to differentiate in place of phi.
    cells
        Cells of this rank on which it is evaluated; default: all owned ones.
    """

    def __init__(
        self,
        waves: "NonlinearWaves | MovingWater",
        *,
        potential: LayeredField | None = None,
        cells: NDArray[np.int32] | None = None,
    ):
        plane, phi = waves.plane, (potential or waves.phi).function
        self._mesh, self._vertical, self._waves = plane.mesh, waves.vertical, waves
        self._modes_at = lru_cache(HEIGHTS)(self._vertical_modes)
        self._zeta = fem.Constant(plane.mesh, 0.0)
        self._values, self._slopes = (fem.Constant(plane.mesh, np.zeros(waves.vertical.n + 1)) for _ in range(2))
        u, w = (ufl.dot(weights, phi) for weights in (self._values, self._slopes))
        along, upward = waves.densities.velocity(u, w, self._zeta)
        ahead, across = ufl.inner(along, plane.chart.direction(plane.mesh)), ufl.as_ufl(0.0)
        if plane.mesh.topology.dim == 2:
            across = ufl.inner(along, ufl.perp(plane.chart.direction(plane.mesh)))
        nodes = plane.V.element.basix_element.points
        self._expression = compile_expression(ufl.as_vector([ahead, across, upward]), nodes, plane.comm)
        self._field = plane.layered_function(3, "velocity")
        owned = plane.mesh.topology.index_map(plane.mesh.topology.dim).size_local
        self.restrict(np.arange(owned, dtype=np.int32) if cells is None else cells)

    def restrict(self, cells: NDArray[np.int32]) -> None:
        """Differentiate on these of the rank's own cells only; collective."""
        self._cells = cells
        own = self._waves.plane.V.dofmap.list[cells].ravel()
        shape = (len(self._field.rows), own.size)
        self._to_nodes = scipy.sparse.csr_matrix((np.ones(own.size), (own, np.arange(own.size))), shape=shape)
        self._sum(np.ones((own.size, 3)))
        self._inverse_counts = 1.0 / np.maximum(self._field.owned, 1.0)

    def _vertical_modes(self, zeta: float) -> tuple[Vector, Vector]:
        """Return values and slopes of the vertical modes at zeta, shape (n+1,) each."""
        heights = np.array([zeta])
        return self._vertical.at(heights)[0], self._vertical.slopes_at(heights)[0]

    def _sum(self, values: Vector) -> None:
        """Set the field to the sum over cells of values at their nodes, shape (cells * nodes, 3), without ghosts."""
        self._field.rows[...] = self._to_nodes @ values
        self._field.function.x.scatter_reverse(la.InsertMode.add)

    def at(self, zeta: float) -> Vector:
        """Return (u, v, w) along, across and upwards [m/s] at zeta in [0, 1]; collective.

        At all degrees of freedom of this rank and its ghosts, shape (owned + ghosts, 3). The next call reuses the
        array.
        """
        self._zeta.value = zeta
        self._values.value, self._slopes.value = self._modes_at(zeta)
        self._sum(self._expression.eval(self._mesh, self._cells).reshape(-1, 3))
        self._field.set(self._inverse_counts * self._field.owned)
        return self._field.rows

    def potential(self, zeta: float) -> Vector:
        """Return phi [m²/s] at zeta in [0, 1], at the degrees of freedom of this rank and its ghosts, shape (rows,)."""
        return np.asarray(self._waves.phi.rows @ self._vertical.at(np.array([zeta]))[0] + self._waves.level)


PART = 2e-3  # largest change of a state in a difference step, relative to water column and depth
STENCIL = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}  # weights of steps for a derivative of fourth order


class MovingWater(ABC):
    """The potential of a state of waves, and its rate; all methods are collective.

    Attributes
    ----------
    waves
        The waves, with their horizontal and vertical space and the wall that can move.
    densities
        Densities of energy and velocity, in UFL.
    h
        Column [m].
    nodes, node_velocities
        Positions of the Gauss nodes zeta of the columns in the laboratory, along x, y and z [m], and their velocities
        [m/s], at all degrees of freedom of this rank and its ghosts, shape (levels, rows, 3).
    phi, phi_rate
        Potential [m²/s] and its rate [m²/s²] at fixed positions (X, zeta), relative to their levels.
    level, level_rate
        Means of potential and rate at the surface.
    """

    head_factor: float  # factor of squared velocities in Bernoulli's sum
    nodes: Vector
    node_velocities: Vector

    def __init__(self, waves: Any, *, h: Field, densities: WaterEnergy, phi: LayeredField):
        self.waves, self.h, self.densities, self.phi = waves, h, densities, phi
        self.plane: Plane = waves.plane
        self.vertical: VerticalBasis = waves.vertical
        self.wall: Wall = waves.wall
        self.phi_rate = self.plane.layered_function(self.vertical.n + 1, "rate of the potential")
        self.level = self.level_rate = 0.0
        self._places = self.plane.chart.places(self.plane.V.tabulate_dof_coordinates())

    @abstractmethod
    def find_rates(self, q: Vector, p: Vector, t: float) -> None:
        """Set potential and rate to those of a state."""

    def head(self, velocity: Vector) -> Vector:
        """Return the contribution of velocities, shape (..., 3), to Bernoulli's sum [m²/s²], shape (...)."""
        return np.asarray(self.head_factor * (velocity**2).sum(axis=-1))

    def _nodes_at(self, heights: Vector) -> Vector:
        """Return ``nodes`` for heights [m], shape (levels, rows)."""
        levels = heights if self.wall.leans else heights[:1]  # an upright wall moves a column uniformly
        along = np.array([self.wall.to_physical(self._places, z) for z in levels])
        return np.concatenate([np.broadcast_to(along, (*heights.shape, 2)), heights[..., None]], axis=-1)


class NonlinearRates(MovingWater):
    """The potential of nonlinear waves, and its rate.

    The waves are evaluated with a separate history of solves, so that the steps of the run are unchanged bit for bit.
    """

    head_factor = 0.5

    def __init__(self, waves: NonlinearWaves):
        super().__init__(waves, h=waves.h, densities=waves.densities, phi=waves.phi)
        self.history = waves.new_history("below the surface")
        self._tangents = list[tuple[MeshMotion, Tangent, PaddleKinematics]]()
        for paddle in waves.wall.paddles:
            tangent = Tangent(paddle.motion)
            along = PaddleKinematics(tangent, paddle.side.along(self.plane.places))
            self._tangents.append((paddle.mesh_motion, tangent, along))
        self._at: tuple[WaterEvaluation, Vector] | None = None  # evaluation and column [m] of the current fields
        self._rates_at: WaterEvaluation | None = None
        self._d = self.plane.function("depth")
        self.nodes = self.node_velocities = np.zeros((self.vertical.n + 1, len(self._places), 3))

    def find(self, q: Vector, p: Vector, t: float) -> WaterEvaluation:
        """Set column and potential to those of a state, and return its evaluation."""
        last = None if self._at is None else self._at[0]
        here = last is not None and t == last.t and np.array_equal(q, last.q) and np.array_equal(p, last.p)
        if summed(self.plane.comm, float(not here)) > 0.0:
            at = self.waves.evaluate(q, p, t, history=self.history, interior=True)
            self._at, self.level = (at, self.h.owned.copy()), self.waves.level
        return self._set_fields()

    def _set_fields(self) -> WaterEvaluation:
        """Set wall, column and potential to those of the last evaluation, and return it: others change them."""
        assert self._at is not None
        at, column = self._at
        assert at.interior is not None
        self.waves.set_time(at.t)
        self.h.set(column)
        self.phi.set(at.interior)
        return at

    def find_rates(self, q: Vector, p: Vector, t: float) -> None:
        """Set potential and rate to those of a state."""
        at, waves = self.find(q, p, t), self.waves
        if at is self._rates_at:
            return
        step = self._step(at.dq)
        residual_rate, self.node_velocities = np.zeros_like(self.phi.owned), np.zeros_like(self.node_velocities)
        with self._along_tangents(t):
            for steps, weight in STENCIL.items():
                waves.set_time(t + steps * step)
                self.h.set(waves.columns.solve(q + steps * step * at.dq))
                waves.operator.update()
                residual_rate += weight / step * waves.residual()
                self.node_velocities += weight / step * self._nodes()
        self._set_fields()
        if self.wall.leans:
            waves.mass.update()
        waves.operator.update()
        self.nodes = self._nodes()
        self.level_rate = self.plane.sum(at.dp) / self.plane.size
        self.phi_rate.owned[:] = 0.0
        self.phi_rate.owned[:, -1] = at.dp - self.level_rate
        self.history.interior.minimiser.find(self.phi_rate.owned, residual_rate)
        self.phi_rate.fetch()
        self._rates_at = at

    @contextmanager
    def _along_tangents(self, t: float) -> Iterator[None]:
        """Let paddles move along the tangents of their motions at t within a context."""
        kinematics = [motion.kinematics for motion, _, _ in self._tangents]
        for motion, tangent, along in self._tangents:
            tangent.at, motion.kinematics = t, along
        yield
        for (motion, _, _), former in zip(self._tangents, kinematics, strict=True):
            motion.kinematics = former

    def _nodes(self) -> Vector:
        """Return the positions of the Gauss nodes of the columns in the laboratory [m], as ``nodes``."""
        self._d.set(self.waves.bed.still)
        return self._nodes_at(self.vertical.zeta[:, None] * self.h.rows[:, 0] - self._d.rows[:, 0])

    def _step(self, q_rate: Vector) -> float:
        """Return the step of the central difference [s]."""
        rising = float(np.abs(self.waves.mass.solve(q_rate) / self.h.owned).max(initial=0.0))
        moving = float(np.abs(self.wall.velocities).max(initial=0.0)) / self.waves.depth
        fastest = self.plane.comm.allreduce(max(rising, moving), op=MPI.MAX)
        return float(PART / fastest) if fastest > 0.0 else 1.0

    @property
    def state(self) -> HistoryState:
        """History of the solves."""
        return self.history.state

    @state.setter
    def state(self, state: HistoryState) -> None:
        self.waves.restore(self.history, state)
        self._at = None


class LinearRates(MovingWater):
    """The potential of linear waves, and its rate; the water extends up to z = 0.

    Potential and rate are two solves of one problem: for psi and X_p', and for psi' = -g eta and X_p''. Velocity heads
    are of second order and vanish.
    """

    head_factor = 0.0

    def __init__(self, waves: LinearWaves, *, tolerance: float):
        plane, h, g = waves.plane, waves.plane.function("water column"), fem.Constant(waves.plane.mesh, waves.gravity)
        h.set(waves.bed.still)
        densities = WaterEnergy(h=h.function, d=waves.bed.d, gravity=g, mapping=waves.wall.mapping)
        super().__init__(waves, h=h, densities=densities, phi=plane.layered_function(waves.vertical.n + 1, "potential"))
        self.nodes = self._nodes_at(np.multiply.outer(self.vertical.zeta - 1.0, h.rows[:, 0]))
        self.node_velocities = np.zeros_like(self.nodes)
        interior = interior_of(densities.column, plane, self.vertical, column=h, tolerance=tolerance)
        self._minimum = interior.minimum()
        interior.operator.update()
        self._minimum.factor()
        self._paddles = [(paddle.motion, waves.flux(paddle, densities)) for paddle in waves.wall.paddles]

    def find_rates(self, q: Vector, p: Vector, t: float) -> None:
        """Set potential and rate to those of a state."""
        rates = [motion.rates(t) for motion, _ in self._paddles]
        self.level = self._solve(self.phi, p, [speed for _, speed, _ in rates])
        p_rate = -self.waves.gravity * self.waves.elevation(q, p, t)
        self.level_rate = self._solve(self.phi_rate, p_rate, [acceleration for _, _, acceleration in rates])

    def _solve(self, field: LayeredField, surface: Vector, speeds: Sequence[float]) -> float:
        """Set a field to the potential below a surface potential, relative to its mean; return the mean; collective."""
        level = self.plane.sum(surface) / self.plane.size
        field.owned[:] = 0.0
        field.owned[:, -1] = surface - level
        fluxes = (speed * flux for speed, (_, flux) in zip(speeds, self._paddles, strict=True))
        self._minimum.find(field.owned, sum(fluxes, start=np.zeros((1, field.owned.shape[1]))))
        field.fetch()
        return level


class Layers(NamedTuple):
    """Kinematics at the levels, at the degrees of freedom of this rank and its ghosts.

    Attributes
    ----------
    velocity
        Velocity along, across and upwards [m/s], shape (levels, rows, 3).
    rate, head
        phi_t and B [m²/s²], shape (levels, rows).
    """

    velocity: Vector
    rate: Vector
    head: Vector


class Kinematics:
    """Kinematics in the neighbourhood of some cells, at the Gauss nodes of the columns.

    Parameters
    ----------
    cells
        Cells of this rank around those of the requested positions; for accelerations two rings of cells.
    """

    def __init__(self, water: MovingWater, cells: NDArray[np.int32]):
        self.water, plane, components = water, water.plane, water.vertical.n + 1
        self.levels = water.vertical.zeta
        self._velocity = Velocity(water, cells=cells)
        self._potentials = [plane.layered_function(components, name) for name in ("phi_t", "B")]
        self._gradients = [Velocity(water, potential=one, cells=cells) for one in self._potentials]
        self._at_levels_of_modes = water.vertical.at(self.levels)
        self._to_modes = np.linalg.inv(self._at_levels_of_modes)

    def restrict(self, cells: NDArray[np.int32]) -> None:
        """Change to other cells; collective."""
        for one in (self._velocity, *self._gradients):
            one.restrict(cells)

    def weights(self, zeta: Vector) -> Vector:
        """Return the weights of values at the levels for interpolation at heights zeta, shape (N, levels)."""
        return self.water.vertical.at(zeta) @ self._to_modes

    def layers(self) -> Layers:
        """Return the parts of the pressure, from which ``accelerations`` follow; collective."""
        water, velocity = self.water, self._at_levels(self._velocity)
        phi_rate = self._at_levels_of_modes @ water.phi_rate.rows.T + water.level_rate
        rate = phi_rate - (water.node_velocities * velocity).sum(axis=-1)
        layers = Layers(velocity, rate, rate + water.head(velocity))
        for field, values in zip(self._potentials, (layers.rate, layers.head), strict=True):
            field.rows[:] = (self._to_modes @ values).T
        return layers

    def accelerations(self) -> tuple[Vector, Vector]:
        """Return the local acceleration and that of the particles [m/s²], in the shape of the velocity; collective."""
        local, total = map(self._at_levels, self._gradients)
        return local, total

    def _at_levels(self, gradient: Velocity) -> Vector:
        return np.array([gradient.at(zeta).copy() for zeta in self.levels])


RINGS = 2  # rings of cells around a point: accelerations are gradients of averaged gradients
AT = 1e-9  # tolerance for points at bed or surface, relative to the water column


class PointValues(NamedTuple):
    """Velocity, acceleration and pressure at N points; meaningless at dry points.

    Attributes
    ----------
    velocity, local, acceleration
        Along x, y and z [m/s, m/s²], shape (N, 3): velocity of the water, its rate at the point, and the acceleration
        of the water particle there.
    pressure
        Pressure relative to the atmosphere [Pa], shape (N,).
    dry
        Whether each point is out of the water, shape (N,).
    """

    velocity: Vector
    local: Vector
    acceleration: Vector
    pressure: Vector
    dry: NDArray[np.bool_]


class PointKinematics:
    """Kinematics at points in the water.

    Parameters
    ----------
    points
        (x, y, z) [m], shape (N, 3); z from still water.
    density
        Density of the water [kg/m³].

    Attributes
    ----------
    points
        Points of the last evaluation.

    Raises ``InputError`` for a point outside the mesh; all methods are collective.
    """

    def __init__(self, water: MovingWater, points: Vector, *, density: float):
        self._water, self._density, self.points = water, density, points
        self._located = Points(water.plane, self._coordinates())
        self._cells = self._located.cells
        self._kinematics = Kinematics(water, water.plane.neighbourhood(self._cells, rings=RINGS))
        self._depth = water.plane.function("depth")

    def _coordinates(self) -> Vector:
        """Return the mesh coordinates of the points, shape (N, 3)."""
        return self._water.plane.chart.place(self._water.wall.to_reference(self.points[:, :2], self.points[:, 2]))

    def evaluate(self, points: Vector | None = None) -> PointValues:
        """Return the values for the state of the last ``find_rates``, at these or the same number of other points.

        Raises ``InputError`` for a point outside the mesh, such as behind a paddle.
        """
        self.points = self.points if points is None else points
        self._located.move(self._coordinates())
        if summed(self._water.plane.comm, float(not np.array_equal(self._located.cells, self._cells))):
            self._cells = self._located.cells
            self._kinematics.restrict(self._water.plane.neighbourhood(self._cells, rings=RINGS))
        water, layers, z = self._water, self._kinematics.layers(), self.points[:, 2]
        self._depth.set(water.waves.bed.still)
        zeta = (z + self._located.evaluate(self._depth)) / self._located.evaluate(water.h)
        weights = self._kinematics.weights(zeta)

        def at(values: Vector) -> Vector:
            """Return values at the points from values at the levels, shape (levels, rows, ...); collective."""
            return np.asarray(np.einsum("nl,nl...->n...", weights, self._located.of(np.moveaxis(values, 0, 1))))

        velocity, rate = at(layers.velocity), at(layers.rate)
        local, total = map(at, self._kinematics.accelerations())
        pressure = -self._density * (rate + water.head(velocity) + water.waves.gravity * z)
        return PointValues(velocity, local, total, pressure, (zeta < -AT) | (zeta > 1 + AT))
