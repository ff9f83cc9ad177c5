"""The power that a paddle puts into the water: dH/dt at fixed (Q, psi), of the formulae of ``piston.py``.

As a form it is assembled anew each time. Along a slice J = 1 + s_X X_p is one at all heights, and with w = phi_zeta / h
and S = phi_X - (zeta h_X - d_X) w the density of energy goes, at fixed phi and h, by

    h/2 (w^2 - S^2 / J^2) J'  +  h S w d'_X / J   and   g/2 eta^2 J'  -  g J eta d',

dashes being rates: that is written out (``power.c``), for the quadrature points of the cells that are carried.
"""

from dataclasses import replace
from importlib.resources import files
from typing import Any, Protocol

import basix
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from wavetank.fe.cell_places import tabulate
from wavetank.fe.forms import ScalarForm, taylor_coefficients
from wavetank.fe.kernels import Kernel, defined
from wavetank.fe.plane import Field, LayeredField, Plane
from wavetank.fe.vertical import VerticalBasis
from wavetank.water.bed import Bed
from wavetank.water.energy import WaterEnergy
from wavetank.water.walls.mapping import Shift
from wavetank.water.walls.travel import Travel
from wavetank.water.walls.work import KeptWork

SOURCE = files(__package__).joinpath("power.c").read_text(encoding="utf-8")
STRIP = """
typedef struct {
    int cells;
    double gravity;
    const int *dofs;
    const double *lengths, *values, *slopes, *measure, *zeta, *shares, *P, *dP;
} Strip;
"""
DECLARATIONS = f"""{STRIP}
double power(const Strip *, double position, double speed, const double *share, const double *phi, const double *column,
             const double *mu, const double *depth, const double *sinking);
"""


class Power(Protocol):
    """dH/dt at fixed (Q, psi) of the fields as they are."""

    def value(self) -> float:
        """Return it; collective."""


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
    mu
        M_J^-1 H_h.
    """

    def __init__(
        self,
        wall: Going,
        energy: WaterEnergy,
        phi: LayeredField,
        *,
        flux: ufl.Form,
        R: Any,
        mu: Field,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
    ):
        def density(dt: Any) -> Any:
            later = replace(energy, mapping=wall.after(dt), d=bed.d + dt * bed.rate)
            return later.kinetic(phi.function, vertical) + later.potential()

        self._travel, (_, rate) = wall.travel, taylor_coefficients(density, 1, plane.mesh)
        moved = rate - wall.speeding.stretching(lambda shape: R) * mu.function
        self._form = ScalarForm(moved * wall.carried + flux, plane.comm)

    def value(self) -> float:
        """Return it; collective."""
        self._travel.show_acceleration()
        return self._form.assemble()


class PowerAlong:
    """That of a vertical paddle along a slice that is on one rank.

    Parameters
    ----------
    work
        W.
    cells
        Those that are carried.
    mu
        M_J^-1 H_h.
    """

    def __init__(
        self,
        work: KeptWork,
        energy: WaterEnergy,
        phi: LayeredField,
        *,
        cells: NDArray[np.int32],
        mu: Field,
        travel: Travel,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
    ):
        self._work, self._travel, self._bed = work, travel, bed
        element, geometry = plane.V.element.basix_element, plane.mesh.geometry
        points, weights = basix.make_quadrature(element.cell_type, plane.degree)
        values, slopes = tabulate(element, 1, points)
        start, end = geometry.x[geometry.dofmap[cells], 0].T
        levels = len(vertical.zeta)
        sizes = {"NODES": element.dim, "POINTS": len(points), "LEVELS": levels, "NUMBERS": vertical.n + 1}
        code = defined(sizes) + STRIP + SOURCE
        self._kernel = Kernel("power", DECLARATIONS, key=code, source=lambda: code, comm=plane.comm)
        numbers = {"cells": len(cells), "gravity": float(energy.gravity.value)}
        along = {
            "dofs": plane.V.dofmap.list[cells],
            "lengths": end - start,
            "values": values,
            "slopes": slopes,
            "measure": np.outer(np.abs(end - start), weights),
        }
        upwards = {
            "zeta": vertical.zeta,
            "shares": vertical.weights,
            "P": vertical.values.T,
            "dP": vertical.slopes.T,
        }
        self._strip = self._kernel.struct("Strip", {**numbers, **along, **upwards})
        self._still: Any = None  # the depths that are here
        self._depth = np.zeros(plane.owned)
        sinking = bed.rate.x.array if isinstance(bed.rate, fem.Function) else np.zeros(plane.owned)
        fields = (travel.share.x.array, phi.rows, energy.h.x.array, mu.owned, self._depth, sinking)
        self._fields = [self._kernel.pointer(field) for field in fields]

    def value(self) -> float:
        """Return it."""
        travel = self._travel
        if self._still is not self._bed.still:
            self._still = self._bed.still
            self._depth[:] = self._still
        going_on = self._kernel.call.power(self._strip, travel.offsets[0], travel.velocities[0], *self._fields)
        return float(going_on + travel.accelerations[0] * self._work.by_speed())
