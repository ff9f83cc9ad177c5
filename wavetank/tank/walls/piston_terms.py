"""What a paddle adds to the Hamiltonian: W, its derivatives and its power; formulae in ``piston.py``.

On any mesh and number of ranks derivatives of W and the power are assembled forms. Along a slice on one rank they are C
code, made of the same densities (``fem/kernels/layers.c``).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from wavetank.base.arrays import Vector
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.density import Density, Statements, named
from wavetank.fem.forms import ScalarForm, VectorForm, derivative_at_zero
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.slice import WallStruct
from wavetank.fem.vertical import VerticalBasis, gauss_legendre
from wavetank.tank.bed import Bed
from wavetank.tank.energy import WaterEnergy


def later(wall: Any, energy: WaterEnergy, bed: Bed, dt: Any) -> WaterEnergy:
    """Return the energy when the wall has gone on at its velocity for dt [s], in UFL."""
    return replace(energy, mapping=wall.after(dt), d=bed.d + dt * bed.rate)


def by_stretching(wall: Any, energy: WaterEnergy, mu: Any) -> Any:
    """Return the density of dH/dt at fixed (Q, psi) by columns, which the wall stretches; mu = M_J^-1 H_h."""
    R = wall.shape.column(energy.h, energy.d)
    return -wall.speeding.stretching(lambda shape: R) * mu


class PistonTerms:
    """What a moving piston adds to the Hamiltonian; see the formulae of ``piston.py``."""

    along: tuple[WallStruct, ...] | None = None

    def __init__(
        self, wall: Any, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, plane: Plane, vertical: VerticalBasis
    ):
        self._wall, self._bed, self._components = wall, bed, phi.owned.shape[1]
        flux = wall.flux_form(energy, phi, vertical)
        work = flux(wall.travel.speed)
        self.hamiltonian = {wall.part: work}
        self._set_up(work, flux, energy, phi, plane=plane, vertical=vertical)
        self._rated = np.nan  # the time of what power depends on [s]

    def _set_up(
        self, work: Any, flux: Any, energy: WaterEnergy, phi: LayeredField, *, plane: Plane, vertical: VerticalBasis
    ) -> None:
        """Compile the forms."""
        self._by_potential = VectorForm(ufl.derivative(work, phi.function))
        self._by_column = VectorForm(ufl.derivative(work, energy.h))
        self._value = ScalarForm(work, plane.comm)
        self._mu = plane.function("mu")

        def density(dt: Any) -> Any:
            after = later(self._wall, energy, self._bed, dt)
            return after.kinetic(phi.function, vertical) + after.potential()

        rate = derivative_at_zero(density, plane.mesh)
        rate += by_stretching(self._wall, energy, self._mu.function)
        self._power = ScalarForm(rate * self._wall.displaced_measure + flux(self._wall.travel.acceleration), plane.comm)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1); collective. The array is reused by the next call."""
        return self._by_potential.assemble().reshape(-1, self._components)

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,); collective. The array is reused by the next call."""
        return self._by_column.assemble()

    def energy(self) -> float:
        """Return W; collective."""
        return self._value.assemble()

    def power(self, mu: Vector) -> float:
        """Return dH/dt at fixed (Q, psi), velocity and acceleration as they are, for M_J^-1 H_h; collective."""
        self._wall.travel.show_acceleration()
        self._mu.set(mu)
        return self._power.assemble()

    def partial_rates(self, mu: Vector) -> tuple[float, float]:
        """Return the same without acceleration, and its derivative by the acceleration; collective."""
        values = list[float]()
        for acceleration in (0.0, 1.0):
            self._wall.travel.accelerate(acceleration)
            values.append(self.power(mu))
        return values[0], values[1] - values[0]

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' at fixed (Q, psi), positive into the water; collective."""
        by_column = mu()
        self._rated = np.nan  # what the rate depends on is to be found again
        with self._wall.travel.going(1.0):
            self._bed.follow_on(self._wall)
            return [self.partial_rates(by_column)]

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); collective."""
        by_column = mu()
        self.follow()
        return self.power(by_column)

    def follow(self) -> None:
        """Take over the rate of the bed's depth as the wall moves; collective."""
        if self._rated != self._wall.travel.t:
            self._rated = self._wall.travel.t
            self._bed.follow_on(self._wall)


class CompiledTerms(PistonTerms):
    """The same along a slice on one rank.

    Parameters
    ----------
    unit
        The translation unit that its functions belong to.
    """

    def __init__(
        self,
        wall: Any,
        energy: WaterEnergy,
        phi: LayeredField,
        *,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
        unit: Unit,
    ):
        self._unit = unit
        super().__init__(wall, energy, phi, bed=bed, plane=plane, vertical=vertical)

    def _set_up(
        self, work: Any, flux: Any, energy: WaterEnergy, phi: LayeredField, *, plane: Plane, vertical: VerticalBasis
    ) -> None:
        wall, self._phi, self._h = self._wall, phi.rows, energy.h.x.array
        self.prefix = "near" if wall.side.sign > 0.0 else "far"
        u, w, psi, mu = (fem.Function(plane.V) for _ in range(4))
        zeta, dt, rate, by_cells, by_levels = (fem.Constant(plane.mesh, 0.0) for _ in range(5))
        blending = wall.travel.blending
        parts = (
            rate * (later(wall, energy, self._bed, dt).column(u, w, zeta) + dt * by_stretching(wall, energy, mu))
            + by_cells * blending * wall.flux(psi, energy)
            + by_levels * wall.side.sign * blending * energy.wall_layer(u, wall.shape.value, zeta)
        )
        names = {u: "u", w: "w", psi: "psi", zeta: "zeta", dt: "dt"}
        names |= {rate: "rate", by_cells: "by_cells", by_levels: "by_levels"}
        density = Density(parts, plane, inputs=names, first=energy.h)
        cells = Cells(plane, plane.degree, only=wall.cells)
        levels, weights = gauss_legendre(vertical.n + 1 + wall.shape.degree // 2)
        sizes = {
            "NUMBERS": vertical.n + 1,
            "LEVELS": len(vertical.zeta),
            "ENDS": len(levels),
            "FIELDS": density.fields,
            "MU": density.index(mu),
            "MOST": vertical.n + 1 + density.fields,
        }
        instance = self._unit.add(
            self.prefix,
            source("cells.c") + source("layers.c", "wall"),
            exports=("by_potential", "by_column", "power"),
            sizes={**cells.sizes, **sizes},
            density=density,
            made={"RATE": _rate, "FLUX": _flux, "END": _end},
        )
        dofs = np.unique(plane.V.dofmap.list[wall.cells])
        water = {"zeta": vertical.zeta, "weights": vertical.weights, "P": vertical.values, "dP": vertical.slopes}
        at_wall = {"zeta": levels, "weights": weights, "P": vertical.at(levels)}
        self.by_potential_rows, self._by_column_rows = np.zeros_like(self._phi), np.zeros_like(self._h)
        self.struct = instance.struct(
            "Wall",
            cells=instance.struct("Cells", **cells.parts),
            layers=instance.struct("Layers", **water, constants=density.constants()),
            end=instance.struct("Layers", **at_wall),
            node=wall.node,
            count=len(dofs),
            dofs=dofs,
            fields=density.values,
            rows=np.zeros((plane.size, density.fields)),
            moves=wall.travel.moves,
            blending=wall.travel.blending.x.array,
            position=wall.travel.position.x.array,
            speed=wall.travel.speed.x.array,
            **dict(zip(("at_still_water", "slope", "mean"), wall.shape.at_still_water, strict=True)),
            by_potential=self.by_potential_rows,
            by_column=self._by_column_rows,
        )
        self._rates, n = np.zeros(2), Buffer(plane.size)
        self._set_by_potential = instance.function("by_potential", self.struct, self._h)
        self._set_by_column = instance.function("by_column", self.struct, self._h, self._phi)
        self._find_power = instance.function("power", self.struct, self._h, self._phi, n, self._rates)

    @property
    def along(self) -> tuple[WallStruct, ...] | None:  # type: ignore[override]
        """The compiled terms of each paddle, along a slice on one rank."""
        return (self,)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1). The array is reused by the next call."""
        self._set_by_potential()
        rows: Vector = self.by_potential_rows
        return rows

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,). The array is reused by the next call."""
        self._set_by_column()
        rows: Vector = self._by_column_rows
        return rows

    def energy(self) -> float:
        """Return W, which is linear in the potential."""
        return float(np.vdot(self.vector(), self._phi))

    def power(self, mu: Vector) -> float:
        """Return dH/dt at fixed (Q, psi), velocity and acceleration as they are, for M_J^-1 H_h."""
        rate, by_acceleration = self.partial_rates(mu)
        return rate + float(self._wall.travel.accelerations) * by_acceleration

    def partial_rates(self, mu: Vector) -> tuple[float, float]:
        """Return the same without acceleration, and its derivative by the acceleration."""
        self._find_power(mu)
        rate, by_acceleration = map(float, self._rates)
        return rate, by_acceleration


def _rate(e: Any) -> Statements:
    return {"value": e.diff(named("rate"), named("dt")).subs(named("dt"), 0)}


def _flux(e: Any) -> Statements:
    flux, slope = e.diff(named("by_cells")), named("psi", 0)
    return {"value": flux, "by_psi_0": flux.diff(slope), "by_h": flux.diff(named("f0"))}


def _end(e: Any) -> Statements:
    flux = e.diff(named("by_levels"))
    return {"value": flux, "by_value": flux.diff(named("u")), "by_h": flux.diff(named("f0"))}
