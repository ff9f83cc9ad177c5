"""Dissipation: smoothing of the surface, gradient-jump penalty and sponge.

The sponge: where the surface potential is damped, and how strongly.

    d psi/dt = -H_h - gamma psi     ([G16] (38)-(45) with gamma = gamma(x, y); the factor itself: integrators/)

gamma grows from nothing, gamma = gamma_0 (distance / width)², with the distance from the sponge's inner edge: a kink or
step would reflect. On linear waves of uniform gamma the amplitude falls at the rate gamma / 2, whatever the depth; a
wave that crosses the sponge and comes back retains e^(-gamma_0 width / (3 c_g)) of it, c_g the group velocity. Which
gamma_0 serves which wave was measured: docs/absorption.md.

Continuous interior penalty: takes the kinks between cells out of eta and psi, where they would grow.

    (M_J + kappa S) v' = M_J v,     S = sum over facets of [[dv/dn]] [[du/dn]],     kappa = epsilon dt omega_g l³ / p⁴

for v = eta and psi, the derivatives those in physical space (tank/walls/): where the mapping of a moving wall has a
kink, a smooth surface has one in the reference tank, and must retain it. l is the cell size and omega_g the frequency
of the shortest wave on it, k_g = pi p / l, omega_g² = g k_g tanh(k_g d). Where the current u under a steep crest
overtakes short waves, k > g / u², those have negative energy, and the kinks of elements that are only continuous couple
them to the others: both grow, whatever the time step. On a smooth field of order p kinks vanish like l^p, so that what
the penalty takes vanishes like l^(2 p). Elements of order 1 need none. Measured in docs/extremes.md: with this scaling
one strength serves p = 2 to 5, kd = 0.5 to 8, and 12 to 128 cells a wave.
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
    """Return gamma [1/s] at distances into the sponge [m], shape (N,): 0 before it, ``strength`` from its width on."""
    return np.asarray(strength * np.clip(distance / width, 0.0, 1.0) ** POWER)


def distance_from_edge(plane: Plane, cells: NDArray[np.int32]) -> tuple[Vector, float]:
    """Return how far the owned degrees of freedom are inside a group of cells, shape (owned,), and at most [m].

    It is the distance from the group's inner edge, where its cells meet others: 0 outside. Collective.

    Parameters
    ----------
    plane
        The horizontal space.
    cells
        This rank's cells of the group, with or without ghosts.

    Raises ``InputError`` for a group without cells, and for one with all cells of the mesh.
    """
    owned = plane.mesh.topology.index_map(plane.mesh.topology.dim).size_local
    is_inside = np.isin(np.arange(owned), cells)
    inside, outside = (_touched(plane, np.flatnonzero(chosen)) for chosen in (is_inside, ~is_inside))
    edge = np.concatenate(plane.comm.allgather(plane.places[inside & outside]))
    if not len(edge):
        raise InputError("the sponge: its group of cells is empty, or the whole mesh; it must be a part of the mesh.")
    distance = np.zeros(plane.owned)
    distance[inside] = scipy.spatial.cKDTree(edge).query(plane.places[inside])[0]
    return distance, largest(plane.comm, float(distance.max(initial=0.0)))


def _touched(plane: Plane, cells: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which owned degrees of freedom belong to some of the cells, on whatever rank those are; collective."""
    mark = plane.function("mark")
    mark.rows[plane.V.dofmap.list[cells].ravel()] = 1.0
    mark.function.x.scatter_reverse(la.InsertMode.add)
    return np.asarray(mark.owned > 0.0)


def checked(plane: Plane, gamma: Vector) -> Vector:
    """Return gamma [1/s], shape (owned,); raises ``InputError`` where it is negative or not finite; collective."""
    bad = np.flatnonzero(~(np.isfinite(gamma) & (gamma >= 0.0)))
    first = (*map(float, plane.places[bad[0]]), float(gamma[bad[0]])) if bad.size else None
    for x, y, received in filter(None, plane.comm.allgather(first)):
        raise InputError(
            f"the sponge: gamma = {received:.4g} 1/s at x = {x:.4g} m, y = {y:.4g} m; it must be 0 or more."
        )
    return gamma


@dataclass(frozen=True)
class SmoothingState:
    """Energy taken so far, and the largest energy before that [m^4/s²]."""

    energy_taken: float = 0.0
    largest: float = 0.0


class Smoothing:
    """v' = (M_J + N)^-1 M_J v for the elevation eta and the surface potential psi, N symmetric with zero row sums.

    It is the elevation that is smoothed, not the column: still water over any bed stays still.

    Parameters
    ----------
    waves
        The water.
    form
        The bilinear form of N in UFL, given trial and test function.

    Attributes
    ----------
    called, gives, cure
        In words, what it is, what makes it give energy instead, and how less is lost to numerics that should take
        little; empty of other filters.
    """

    called, cure = "smoothing", ""
    gives = "possible causes are waves too short or too steep for the step and the cells"

    def __init__(self, waves: NonlinearWaves, form: Callable[[Any, Any], ufl.Form]):
        self._waves, self._of = waves, form
        self._energy = SmoothingState()

    @property
    def energy_taken(self) -> float:
        """Energy taken so far [m^4/s²]."""
        return self._energy.energy_taken

    @property
    def state(self) -> Any:
        """Energy taken so far, and what else a later step depends on, as plain data."""
        return self._energy

    @state.setter
    def state(self, state: Any) -> None:
        self._energy = state

    @cached_property
    def matrix(self) -> PenalisedMass | GradientJumpPenalty:
        """M_J + N, made where it is first needed; collective."""
        return self._made(self._waves.wall.mapping.J(self._waves.densities.eta))

    def _made(self, J: Any) -> PenalisedMass | GradientJumpPenalty:
        """Return M_J + N of the form, for J in UFL; collective."""
        return PenalisedMass(self._waves.plane, self._waves.mass, J, self._of)

    def update(self) -> None:
        """Assemble N for the present values of what its form depends on, the wall among them; collective."""
        self.matrix.update()

    def passed(self, pairs: Vector) -> Vector:
        """Return Q - N eta', whose sum, the mass, is that of Q, and psi' of points [Q, psi], shape (m, 2, owned).

        The solution at one point is the start value at the next, which is close to it.
        """
        result, solve, N = np.empty_like(pairs), self.matrix.solve, self.matrix.penalty
        by_eta = by_psi = np.zeros(pairs.shape[2:])  # v - v' = (M_J + N)^-1 N v
        for (q, psi), after in zip(pairs, result, strict=True):
            eta = self._waves.columns.solve(q) - self._waves.bed.still
            by_eta, by_psi = solve(N(eta), by_eta), solve(N(psi), by_psi)
            after[:] = q - N(eta - by_eta), psi - by_psi
        return result

    def account(self, loss: float, *, of: float) -> None:
        """Add a loss of energy, of the energy before."""
        self._energy = SmoothingState(self.energy_taken + loss, max(self._energy.largest, of))


NEEDED = 1.5  # u² k_g / g; growth was measured from 2.1 on, none below
STRENGTH = 0.25  # epsilon: 0.08 to 0.8 serve; more makes waves of negative energy grow


class EdgePenalty(Smoothing):
    """The penalty for one step size, applied only while it is needed.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    cell_size
        l [m].
    dt
        Step [s].
    strength
        epsilon [-].
    threshold
        Of u² k_g / g; 0 for always.
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
        self._fast = float(np.sqrt(threshold * waves.gravity / k)) if plane.order > 1 else np.inf  # so it is needed

    def _made(self, J: Any) -> PenalisedMass | GradientJumpPenalty:
        """Return it banded along a slice on one rank, unless the wall's shape stretches what it displaces."""
        plane, wall = self._waves.plane, self._waves.wall
        if not isinstance(self._waves.mass, BandedMass) or plane.mesh.geometry.dim > 1 or wall.leans:
            return super()._made(J)
        shift = next((displacement for displacement, _ in wall.shifts), None)
        return GradientJumpPenalty(plane, J, strength=self._kappa, shift=shift)

    def needed(self, state: State, t: float) -> bool:
        """Return whether the current overtakes the shortest waves by so much; never with p = 1; collective."""
        self._flow.update_from(state, t)
        if self._flow.largest_velocity <= self._fast:
            return False
        if self._waves.wall.moves:
            self._waves.set_time(t)
            self.update()
        return True


def shortest_wave_number(waves: NonlinearWaves, cell_size: float) -> float:
    """Return k_g = pi p / l of cells of size l [m], in 1/m."""
    return float(np.pi * waves.plane.order / cell_size)
