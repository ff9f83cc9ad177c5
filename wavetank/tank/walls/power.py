"""The power that a paddle puts into the water: dH/dt at fixed (Q, psi), of the formulae of ``piston.py``.

As a form it is assembled anew each time. Along a slice the water has, with w = phi_zeta / h and J = 1 + s_X f X_p, the
velocity u = S / J, S = phi_X - (zeta h_X - d_X) w, and v = w - s f' X_p u upwards; over a flat bed the density of its
energy goes, at fixed phi and h, by

    h X_p' { s_X f / 2 (v^2 - u^2) - s f' u v }   and   g s_X X_p' int f z dz from still water to the surface.

A vertical paddle, f = 1, may carry water over any bed, which adds h S w d'_X / J and -g J eta d', d' the rate of d. All
is written out (``power.c``), with what mu and X_p'' add to it, for the quadrature points of the cells that are carried.
What does not change is kept there: the share s and its slope, and those of the bed until the wall has carried it on.
"""

from dataclasses import replace
from typing import Any, ClassVar, Protocol

import basix
import numpy as np
import ufl
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.forms import ScalarForm, taylor_coefficients
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis, gauss_legendre
from wavetank.tank.bed import Bed
from wavetank.tank.energy import WaterEnergy
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.shape import Shape, coefficients
from wavetank.tank.walls.travel import Travel

SOURCE = source("power.c", __package__)
STRIP = """
typedef struct {
    int cells, nodes, paddle;
    double gravity, still, unit, mean;
    const int *dofs;
    const double *lengths, *values, *slopes, *measure, *zeta, *upwards, *levels, *means;
    const double *shape, *slope, *integral, *moment;
    const double *share, *stretch, *depth, *depth_x, *sinking, *sinking_x, *phi, *column;
    double *rows, *held;
} Strip;
"""
DECLARATIONS = f"""{STRIP}
void hold(const Strip *, const double *mu);
void push(const Strip *, double position, double speed, const double *mu, int between, double *found);
"""
FOUR = 4  # points at a time, and numbers


class Power(Protocol):
    """dH/dt at fixed (Q, psi) of the fields as they are.

    Attributes
    ----------
    compiled
        What it is found with, for ``fem/whole.c``, if it can be.
    """

    @property
    def compiled(self) -> dict[str, Any]:
        """See above."""

    def follow(self) -> None:
        """Take over acceleration and bed as they are; collective."""

    def value(self, mu: Vector) -> float:
        """Return it for M_J^-1 H_h, shape (owned,); collective."""

    def push(self, mu: Vector) -> tuple[float, float]:
        """Return it where the paddle goes on at its velocity, and dH/dX', for the same; collective."""


class Going(Protocol):
    """A paddle, as its power sees it."""

    @property
    def travel(self) -> Travel:
        """How far and how fast it goes."""

    @property
    def carried(self) -> ufl.Measure:
        """The measure over the cells that it carries."""

    @property
    def speeding(self) -> Shift:
        """How the mapping goes on, a second further."""

    def after(self, dt: Any) -> Shift:
        """Return the mapping when the paddle has gone on for dt [s], as it moves now; dt in UFL."""


class AssembledPower:
    """That of any paddle.

    Parameters
    ----------
    flux
        W with accelerations in the place of velocities.
    R
        int f dz over the column.
    """

    compiled: ClassVar[dict[str, Any]] = {}

    def __init__(
        self,
        wall: Going,
        energy: WaterEnergy,
        phi: LayeredField,
        *,
        flux: ufl.Form,
        R: Any,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
    ):
        def density(dt: Any) -> Any:
            later = replace(energy, mapping=wall.after(dt), d=bed.d + dt * bed.rate)
            return later.kinetic(phi.function, vertical) + later.potential()

        self._travel, (_, rate) = wall.travel, taylor_coefficients(density, 1, plane.mesh)
        self._mu = plane.function("mu")
        moved = rate - wall.speeding.stretching(lambda shape: R) * self._mu.function
        self._form = ScalarForm(moved * wall.carried + flux, plane.comm)

    def follow(self) -> None:
        """Take over the acceleration as it is; forms know the bed; collective."""
        self._travel.show_acceleration()

    def value(self, mu: Vector) -> float:
        """Return it for M_J^-1 H_h, shape (owned,); collective."""
        self._mu.set(mu)
        return self._form.assemble()

    def push(self, mu: Vector) -> tuple[float, float]:
        """Return it where the paddle goes on at its velocity, and dH/dX', for the same; collective."""
        values = list[float]()
        for acceleration in (0.0, 1.0):
            self._travel.accelerate(acceleration)
            self.follow()
            values.append(self.value(mu))
        return values[0], values[1] - values[0]


class PowerAlong:
    """That of a paddle along a slice that is on one rank: a vertical one, or of a polynomial's shape over a flat bed.

    Parameters
    ----------
    shape
        f.
    cells
        Those that are carried.
    node
        The degree of freedom at which it stands.
    """

    def __init__(
        self,
        shape: Shape,
        energy: WaterEnergy,
        phi: LayeredField,
        *,
        cells: NDArray[np.int32],
        node: int,
        travel: Travel,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
    ):
        self._travel, self._bed, element = travel, bed, plane.V.element.basix_element
        points, weights = basix.make_quadrature(element.cell_type, plane.degree)
        more = -len(points) % FOUR  # the last point again, which weighs nothing there
        points, weights = np.concatenate([points, points[-1:].repeat(more, axis=0)]), np.pad(weights, (0, more))
        order = np.argsort(element.points[:, 0])
        self._values, self._slopes = tabulate(element, 1, points)[:, :, order].transpose(0, 2, 1)
        dofs = np.unique(plane.V.dofmap.list[cells])
        dofs = dofs[np.argsort(plane.x[dofs])]
        self._nodes = dofs[plane.order * np.arange(len(cells))[:, None] + np.arange(element.dim)]
        self._lengths = plane.x[self._nodes[:, -1]] - plane.x[self._nodes[:, 0]]
        upwards = np.sqrt(vertical.weights) * np.stack([vertical.values.T, vertical.slopes.T], axis=1)
        upwards = upwards.reshape(vertical.n + 1, -1)
        width, levels = -(-upwards.shape[1] // FOUR), len(vertical.zeta)
        share, stretch = self._at_points(travel.share.x.array)
        bed_parts = ("depth", "depth_x", "sinking", "sinking_x")
        self._at_bed = {name: np.zeros((len(cells), len(points))) for name in bed_parts}
        self._depth: Any = None  # what of the bed is there
        self._sinking: Any = None
        at_paddle, shares = gauss_legendre(vertical.n + 1 + shape.degree // 2)
        sizes = {"NODES": element.dim, "GROUPS": len(points) // FOUR, "LEVELS": levels, "NUMBERS": vertical.n + 1}
        sizes |= {"WIDTH": width, "DEGREE": shape.degree, "AT_PADDLE": len(at_paddle)}
        code = defined(sizes) + STRIP + SOURCE
        self._kernel = Kernel("power", DECLARATIONS, key=code, comm=plane.comm)
        parts = {
            "cells": len(cells),
            "nodes": len(dofs),
            "paddle": int(np.flatnonzero(dofs == node)[0]),
            "gravity": float(energy.gravity.value),
            "dofs": dofs,
            "lengths": self._lengths,
            "values": self._values,
            "slopes": self._slopes,
            "measure": np.outer(self._lengths, weights),
            "zeta": vertical.zeta,
            "upwards": np.pad(upwards, ((0, 0), (0, FOUR * width - upwards.shape[1]))),
            "levels": at_paddle,
            "means": shares[:, None] * vertical.at(at_paddle)[:, :-1],
            "still": float(np.broadcast_to(bed.still, plane.owned)[node]),
            "mean": shape.near_still[2],
            **coefficients(shape),
            "share": share,
            "stretch": stretch,
            "phi": phi.rows,
            "column": energy.h.x.array,
            **{name: np.zeros((len(dofs), vertical.n + 3)) for name in ("rows", "held")},
        }
        self._strip = self._kernel.struct("Strip", {**parts, **self._at_bed})
        self._found = np.zeros(2)
        self._at_found = self._kernel.pointer(self._found)

    def _at_points(self, rows: Vector) -> tuple[Vector, Vector]:
        """Return values and slopes of a field, shape (dofs,), at the points, shape (cells, points)."""
        nodes = rows[self._nodes]
        return nodes @ self._values, nodes @ self._slopes / self._lengths[:, None]

    def _take(self, name: str, of_bed: Vector | float) -> Vector | float:
        """Take over, at the points, a field of the bed's or what is the same everywhere; return it."""
        if not isinstance(of_bed, float):
            self._at_bed[name][:], self._at_bed[f"{name}_x"][:] = self._at_points(of_bed)
        else:
            self._at_bed[name][:] = of_bed
        return of_bed

    @property
    def compiled(self) -> dict[str, Any]:
        """See ``Power``."""
        address = self._kernel.address
        return {"hold": address("hold"), "push": address("push"), "strip": address(self._strip)}

    def follow(self) -> None:
        """Take over the bed as it is."""
        bed = self._bed
        if self._depth is not bed.still:
            self._depth = self._take("depth", bed.still)
        if self._sinking is not bed.sinking:
            self._sinking = self._take("sinking", bed.sinking)

    def value(self, mu: Vector) -> float:
        """Return it for M_J^-1 H_h, shape (owned,)."""
        going, by_speed = self.push(mu)
        return going + float(self._travel.accelerations) * by_speed

    def push(self, mu: Vector) -> tuple[float, float]:
        """Return it where the paddle goes on at its velocity, and dH/dX', for the same."""
        moves = float(self._travel.offsets), float(self._travel.velocities)
        self._kernel.call.push(self._strip, *moves, self._kernel.pointer(mu), 0, self._at_found)
        return self._at_found[0], self._at_found[1]
