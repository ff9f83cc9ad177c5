"""Dissipation: smoothing of the surface, gradient-jump penalty and sponge.

The sponge: the damping of the surface potential as a function of position.

    d psi/dt = -H_h - gamma psi     ([G16] (38)-(45) with gamma = gamma(x, y); the factor itself: integrators/)

gamma increases from zero, gamma = gamma_0 (distance / width)², with the distance from the sponge's inner edge: a kink
or step would reflect. For linear waves and uniform gamma the amplitude decays at the rate gamma / 2, for any depth; a
wave that crosses the sponge twice retains e^(-gamma_0 width / (3 c_g)) of it, c_g the group velocity.
docs/absorption.md has measurements of suitable gamma_0.

Continuous interior penalty: removes the kinks between cells from eta and psi where they would grow.

    (M_J + kappa S) v' = M_J v,     S = sum over facets of [[dv/dn]] [[du/dn]],     kappa = epsilon dt omega_g l³ / p⁴

for v = eta and psi, with derivatives in physical space (tank/walls/): where the mapping of a moving wall has a
kink, a smooth surface has one in the reference tank, and must retain it. l is the cell size and omega_g the frequency
of the shortest wave on it, k_g = pi p / l, omega_g² = g k_g tanh(k_g d). Where the current u under a steep crest
overtakes short waves, k > g / u², these have negative energy, and the kinks of continuous elements couple
them to the others: both grow, for any time step. On a smooth field and order p kinks vanish like l^p, so that the
dissipation by the penalty vanishes like l^(2 p). Elements of order 1 do not need it. Measurements in docs/extremes.md:
with this scaling one strength is suitable for p = 2 to 5, kd = 0.5 to 8, and 12 to 128 cells per wave.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, largest
from wavetank.base.errors import InputError
from wavetank.fem.gradient_jumps import GradientJumpPenalty
from wavetank.fem.mass import BandedMass, PenalisedMass
from wavetank.fem.plane import Plane
from wavetank.integrators.contract import State
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

POWER = 2


def profile(distance: Vector, *, width: float, strength: float) -> Vector:
    """Return gamma [1/s] at distances into the sponge [m], shape (N,): 0 before it, ``strength`` beyond its width."""
    return np.asarray(strength * np.clip(distance / width, 0.0, 1.0) ** POWER)


def distance_from_edge(plane: Plane, cells: NDArray[np.int32]) -> tuple[Vector, float]:
    """Return the depths of the owned degrees of freedom inside a group of cells, shape (owned,), and the maximum [m].

    The depth is the distance from the group's inner edge, at which its cells meet others; 0 outside. Collective.

    Parameters
    ----------
    plane
        Horizontal space.
    cells
        Cells of the group on this rank, with or without ghosts.

    Raises ``InputError`` for a group without cells, and for a group of all cells of the mesh.
    """
    owned = plane.mesh.topology.index_map(plane.mesh.topology.dim).size_local
    is_inside = np.isin(np.arange(owned), cells)
    inside, outside = (_touched(plane, np.flatnonzero(chosen)) for chosen in (is_inside, ~is_inside))
    edge = np.concatenate(plane.comm.allgather(plane.places[inside & outside]))
    if not len(edge):
        raise InputError("the sponge: its group of cells is empty, or the whole mesh; must be a part of the mesh.")
    distance = np.zeros(plane.owned)
    distance[inside] = scipy.spatial.cKDTree(edge).query(plane.places[inside])[0]
    return distance, largest(plane.comm, float(distance.max(initial=0.0)))


def _touched(plane: Plane, cells: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether each owned degree of freedom belongs to one of the cells, of any rank; collective."""
    mark = plane.function("mark")
    mark.rows[plane.V.dofmap.list[cells].ravel()] = 1.0
    mark.function.x.scatter_reverse(la.InsertMode.add)
    return np.asarray(mark.owned > 0.0)


def checked(plane: Plane, gamma: Vector) -> Vector:
    """Return gamma [1/s], shape (owned,); raises ``InputError`` if it is negative or not finite; collective."""
    bad = np.flatnonzero(~(np.isfinite(gamma) & (gamma >= 0.0)))
    first = (*map(float, plane.places[bad[0]]), float(gamma[bad[0]])) if bad.size else None
    for x, y, received in filter(None, plane.comm.allgather(first)):
        raise InputError(f"the sponge: gamma = {received:.4g} 1/s at x = {x:.4g} m, y = {y:.4g} m; must be 0 or more.")
    return gamma


@dataclass(frozen=True)
class SmoothingState:
    """Dissipated energy, and the largest energy before [m^4/s²]."""

    energy_taken: float = 0.0
    largest: float = 0.0


class Smoothing:
    """v' = (M_J + N)^-1 M_J v for the elevation eta and the surface potential psi, N symmetric with zero row sums.

    The filter smooths the elevation, not the column: still water over any bed is unchanged.

    Parameters
    ----------
    waves
        The water.
    form
        Bilinear form of N in UFL, as a function of trial and test function.

    Attributes
    ----------
    called, gives, cure
        Texts for warnings: name of the filter, causes of a gain of energy, remedy for an unwanted numerical loss; empty
        for other filters.
    """

    called, cure = "smoothing", ""
    gives = "possible causes are waves too short or too steep for the step and the cells"

    def __init__(self, waves: NonlinearWaves, form: Callable[[Any, Any], ufl.Form]):
        self._waves, self._of = waves, form
        self._energy = SmoothingState()

    @property
    def energy_taken(self) -> float:
        """Dissipated energy [m^4/s²]."""
        return self._energy.energy_taken

    @property
    def state(self) -> Any:
        """Dissipated energy, and further data that later steps depend on."""
        return self._energy

    @state.setter
    def state(self, state: Any) -> None:
        self._energy = state

    @cached_property
    def matrix(self) -> PenalisedMass | GradientJumpPenalty:
        """M_J + N, assembled at its first use; collective."""
        return self._made(self._waves.wall.mapping.J(self._waves.densities.eta))

    def _made(self, J: Any) -> PenalisedMass | GradientJumpPenalty:
        """Return M_J + N of the form, for J in UFL; collective."""
        return PenalisedMass(self._waves.plane, self._waves.mass, J, self._of)

    def update(self) -> None:
        """Assemble N for the current coefficients of its form and the position of the wall; collective."""
        self.matrix.update()

    def passed(self, pairs: Vector) -> Vector:
        """Return Q - N eta', whose sum, the mass, is that of Q, and psi' of points [Q, psi], shape (m, 2, owned).

        The solution at one point is the start value at the next one, which is close to it.
        """
        result, solve, N = np.empty_like(pairs), self.matrix.solve, self.matrix.penalty
        by_eta = by_psi = np.zeros(pairs.shape[2:])  # v - v' = (M_J + N)^-1 N v
        for (q, psi), after in zip(pairs, result, strict=True):
            eta = self._waves.columns.solve(q) - self._waves.bed.still
            by_eta, by_psi = solve(N(eta), by_eta), solve(N(psi), by_psi)
            after[:] = q - N(eta - by_eta), psi - by_psi
        return result

    def account(self, loss: float, *, of: float) -> None:
        """Record a loss of energy; ``of`` is the energy before."""
        self._energy = SmoothingState(self.energy_taken + loss, max(self._energy.largest, of))


NEEDED = 1.5  # u² k_g / g above which the penalty acts; measured growth begins at 2.1
STRENGTH = 0.25  # epsilon: 0.08 to 0.8 are suitable; larger values make waves of negative energy grow


class EdgePenalty(Smoothing):
    """The gradient-jump penalty for one step size, applied only when it is needed.

    Parameters
    ----------
    waves
        The water.
    flow
        Flow at its surface, updated here.
    cell_size
        l [m].
    dt
        Time step [s].
    strength
        epsilon [-].
    threshold
        Threshold of u² k_g / g; 0: always.
    """

    called, cure = "the edge penalty", "finer cells lose less, unless waves break"

    def __init__(
        self,
        waves: NonlinearWaves,
        flow: SurfaceVelocity,
        *,
        cell_size: float,
        dt: float,
        strength: float = STRENGTH,
        threshold: float = NEEDED,
    ):
        plane, k, n = waves.plane, shortest_wave_number(waves, cell_size), ufl.FacetNormal(waves.plane.mesh)
        rate = float(np.sqrt(waves.gravity * k * np.tanh(k * waves.depth)))
        self._kappa = strength * abs(dt) * rate * cell_size**3 / plane.order**4
        kappa = fem.Constant(plane.mesh, self._kappa)
        facets = ufl.dS(domain=plane.mesh, metadata={"quadrature_degree": 2 * plane.order})

        def penalty(u: Any, v: Any) -> ufl.Form:
            one, other = (ufl.jump(waves.wall.mapping.gradient(f, waves.densities.eta), n) for f in (u, v))
            return kappa * one * other * facets

        super().__init__(waves, penalty)
        self._flow = flow
        self._fast = float(np.sqrt(threshold * waves.gravity / k)) if plane.order > 1 else np.inf  # threshold [m/s]

    def _made(self, J: Any) -> PenalisedMass | GradientJumpPenalty:
        """Return the matrix, banded along a slice on one rank, unless the shape of the wall stretches elements."""
        plane, wall = self._waves.plane, self._waves.wall
        if not isinstance(self._waves.mass, BandedMass) or plane.mesh.geometry.dim > 1 or wall.leans:
            return super()._made(J)
        shift = next((displacement for displacement, _ in wall.shifts), None)
        return GradientJumpPenalty(plane, J, strength=self._kappa, shift=shift)

    def needed(self, state: State, t: float) -> bool:
        """Return whether the current overtakes the shortest waves by the threshold; never with p = 1; collective."""
        self._flow.update_from(state, t)
        if self._flow.largest_velocity <= self._fast:
            return False
        if self._waves.wall.moves:
            self._waves.set_time(t)
            self.update()
        return True


def shortest_wave_number(waves: NonlinearWaves, cell_size: float) -> float:
    """Return k_g = pi p / l for cells of size l [m], in 1/m."""
    return float(np.pi * waves.plane.order / cell_size)
