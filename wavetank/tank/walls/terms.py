"""The part of the Hamiltonian that paddles add.

    W = F(X_p'),     F(v) = - int s v R a . grad psi dX + int v h f (phi - psi) dzeta at the paddle

with the shape f(z) of the paddle and R = int f dz over the column, for a vertical wall f = 1 and R = h. By parts this
is int psi a . grad(s v R) dX + int v h f phi dzeta; in the form above psi = phi = 1 gives zero for any quadrature. H(Q,
psi, t) depends on time through X_p, X_p' and the depth under displaced points, so at fixed (Q, psi)

    dH/dt = d/dt (K + V)  -  int a . grad(s X_p') R mu dX  +  F(X_p''),     mu = M_J^-1 H_h     (ours)

The first term is the rate with X_p and d at their current velocities. The second follows from the change of h at fixed
Q = h + a . grad(s X_p) R.

On any mesh and number of ranks derivatives of W and the power are assembled forms. Along a slice on one rank they are C
code, generated from the same densities (``fem/kernels/layers.c``).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from wavetank.base.arrays import Vector, summed
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, source
from wavetank.fem.density import Density, Statements, named
from wavetank.fem.forms import ScalarForm, VectorForm, derivative_at_zero
from wavetank.fem.plane import LayeredField
from wavetank.fem.slice import WallStruct
from wavetank.fem.vertical import VerticalBasis, gauss_legendre
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.paddle import DESCRIPTIONS, Paddle


class WallTerms:
    """W, its derivatives and the power of all paddles.

    Parameters
    ----------
    wall, paddles
        The walls, and the moving paddles.
    water
        The ``DiscreteEnergy`` with densities, potential, bed, vertical space and translation unit, here and below.

    Attributes
    ----------
    hamiltonian
        W in UFL under its name; empty without paddles.
    along
        W of each paddle as compiled code, along a slice on one rank; None elsewhere.
    """

    def __init__(self, wall: Any, paddles: Sequence[Paddle], water: Any):
        self._wall, self._paddles, self._bed = wall, paddles, water.bed
        self._plane, self._phi = water.plane, water.phi
        self._t = np.nan  # the time of the rate of the bed's depth [s]
        self._each: list[AssembledTerms | CompiledTerms] = []
        self.along: tuple[WallStruct, ...] | None = ()
        self.hamiltonian = dict[Part, ufl.Form]()
        for paddle in paddles:
            part, _ = DESCRIPTIONS["leaning" if paddle.leans else "upright"]
            flux = flux_form(paddle, water.densities, water.phi, water.vertical)
            work = flux(paddle.mesh_motion.speed.function)
            self.hamiltonian[part._replace(name="far wall") if self.hamiltonian else part] = work
            if paddle.plane.mesh.topology.dim == 1 and paddle.plane.comm.size == 1:
                terms = CompiledTerms(paddle, water, follow=self._follow)
                self._each.append(terms)
                self.along = (*(self.along or ()), terms)
            else:
                self._each.append(AssembledTerms(paddle, water, flux=flux))
                self.along = None
        self._zero = np.zeros((1, water.vertical.n + 1))

    def vector(self) -> Vector:
        """Return dW/dphi, broadcastable to shape (owned, n+1); collective. The next call may reuse the array."""
        return reduce(np.add, [terms.vector() for terms in self._each] or [self._zero])

    def by_column(self) -> Vector:
        """Return dW/dh, broadcastable to shape (owned,); collective. The next call may reuse the array."""
        return reduce(np.add, [terms.by_column() for terms in self._each] or [self._zero[:, 0]])

    def energy(self) -> float:
        """Return W, which is linear in the potential; collective."""
        if not self._each:
            return 0.0
        return summed(self._plane.comm, float(np.vdot(self.vector(), self._phi.owned)))

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' of each paddle at fixed (Q, psi), positive into the water; ``mu`` as below."""
        by_column, self._t, result = mu(), np.nan, list[tuple[float, float]]()
        for paddle, terms in zip(self._paddles, self._each, strict=True):
            with paddle.mesh_motion.at_speed(1.0):
                self._bed.follow_on(self._wall)
                rate, faster = (terms.power(by_column, acceleration) for acceleration in (0.0, 1.0))
                result.append((rate, faster - rate))
        return result

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); ``mu`` evaluates that point and returns M_J^-1 H_h; collective."""
        by_column = mu()
        self._follow()
        return sum(terms.power(by_column) for terms in self._each)

    def _follow(self) -> None:
        """Update the rate of the bed's depth for the motion of the wall; collective."""
        if self._paddles and self._t != self._paddles[0].mesh_motion.t:
            self._t = self._paddles[0].mesh_motion.t
            self._bed.follow_on(self._wall)


def flux_form(
    paddle: Paddle, energy: WaterEnergy, phi: LayeredField, vertical: VerticalBasis
) -> Callable[[Any], ufl.Form]:
    """Return the form of F for a field s v [m/s] along the axis; at the paddle s = 1."""
    plane, shape = paddle.plane, paddle.shape
    in_water = paddle.flux(phi.function[vertical.n], energy)
    at_wall = energy.wall_flux(phi.function, vertical, shape.value, degree=shape.degree)
    into = -ufl.inner(ufl.FacetNormal(plane.mesh), paddle.axis)
    surface = paddle.side.surface(plane.mesh)
    if paddle.leans:  # its degree would require far more points than the quadrature of the water
        surface = surface(metadata=plane.dx.metadata())
    return lambda speed: speed * in_water * paddle.displaced_measure + into * speed * at_wall * surface


def later(paddle: Paddle, water: Any, dt: Any) -> WaterEnergy:
    """Return the energy after a motion of the wall for dt [s] at its current velocity, in UFL."""
    energy: WaterEnergy = water.densities
    return replace(energy, mapping=paddle.after(dt), d=water.bed.d + dt * water.bed.rate)


class AssembledTerms:
    """W, its derivatives and the power of a paddle as forms."""

    def __init__(self, paddle: Paddle, water: Any, *, flux: Callable[[Any], ufl.Form]):
        plane, energy, phi, self._motion = paddle.plane, water.densities, water.phi, paddle.mesh_motion
        work = flux(self._motion.speed.function)
        self._components = phi.owned.shape[1]
        self._by_potential = VectorForm(ufl.derivative(work, phi.function))
        self._by_column = VectorForm(ufl.derivative(work, energy.h))
        self._mu = plane.function("mu")

        def density(dt: Any) -> Any:
            after = later(paddle, water, dt)
            return after.kinetic(phi.function, water.vertical) + after.potential()

        rate = derivative_at_zero(density, plane.mesh) + paddle.stretching(energy, self._mu.function)
        power = rate * paddle.displaced_measure + flux(self._motion.acceleration.function)
        self._power = ScalarForm(power, plane.comm)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1); collective. The array is reused by the next call."""
        return self._by_potential.assemble().reshape(-1, self._components)

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,); collective. The array is reused by the next call."""
        return self._by_column.assemble()

    def power(self, mu: Vector, acceleration: float | None = None) -> float:
        """Return dH/dt at fixed (Q, psi) for M_J^-1 H_h, with an acceleration or that of the motion; collective."""
        self._motion.accelerate(acceleration)
        self._mu.set(mu)
        return self._power.assemble()


class CompiledTerms:
    """W, its derivatives and the power of a paddle along a slice on one rank: a ``WallStruct``.

    Parameters
    ----------
    follow
        Function that updates the rate of the bed's depth.
    """

    def __init__(self, paddle: Paddle, water: Any, *, follow: Callable[[], None]):
        plane, motion, shape = paddle.plane, paddle.mesh_motion, paddle.shape
        energy, vertical = water.densities, water.vertical
        self._motion, self._phi, self._h, self.follow = motion, water.phi.rows, energy.h.x.array, follow
        self.prefix = "near" if paddle.side.sign > 0.0 else "far"
        u, w, psi, mu = (fem.Function(plane.V) for _ in range(4))
        zeta, dt, rate, by_cells, by_levels = (fem.Constant(plane.mesh, 0.0) for _ in range(5))
        blending = motion.blending.function
        parts = (
            rate * (later(paddle, water, dt).column(u, w, zeta) + dt * paddle.stretching(energy, mu))
            + by_cells * blending * paddle.flux(psi, energy)
            + by_levels * paddle.side.sign * blending * energy.wall_layer(u, shape.value, zeta)
        )
        names = {u: "u", w: "w", psi: "psi", zeta: "zeta", dt: "dt"}
        names |= {rate: "rate", by_cells: "by_cells", by_levels: "by_levels"}
        density = Density(parts, plane, inputs=names, first=energy.h)
        cells = Cells(plane, plane.degree, only=paddle.cells)
        levels, weights = gauss_legendre(vertical.n + 1 + shape.degree // 2)
        sizes = {
            "NUMBERS": vertical.n + 1,
            "LEVELS": len(vertical.zeta),
            "ENDS": len(levels),
            "FIELDS": density.fields,
            "MU": density.index(mu),
            "MOST": vertical.n + 1 + density.fields,
        }
        instance = water.unit.add(
            self.prefix,
            source("cells.c") + source("layers.c", "wall"),
            exports=("by_potential", "by_column", "power"),
            sizes={**cells.sizes, **sizes},
            density=density,
            made={"RATE": _rate, "FLUX": _flux, "END": _end},
        )
        dofs = np.unique(plane.V.dofmap.list[paddle.cells])
        water = {"zeta": vertical.zeta, "weights": vertical.weights, "P": vertical.values, "dP": vertical.slopes}
        at_wall = {"zeta": levels, "weights": weights, "P": vertical.at(levels)}
        self.by_potential_rows, self._by_column_rows = np.zeros_like(self._phi), np.zeros_like(self._h)
        self.struct = instance.struct(
            "Wall",
            cells=instance.struct("Cells", **cells.parts),
            layers=instance.struct("Layers", **water, constants=density.constants()),
            end=instance.struct("Layers", **at_wall),
            node=paddle.node,
            count=len(dofs),
            dofs=dofs,
            fields=density.values,
            rows=np.zeros((plane.size, density.fields)),
            moves=motion.rates,
            blending=blending.x.array,
            position=motion.position.function.x.array,
            speed=motion.speed.function.x.array,
            **dict(zip(("at_still_water", "slope", "mean"), shape.at_still_water, strict=True)),
            by_potential=self.by_potential_rows,
            by_column=self._by_column_rows,
        )
        self._rates, n = np.zeros(2), Buffer(plane.size)
        self._set_by_potential = instance.function("by_potential", self.struct, self._h)
        self._set_by_column = instance.function("by_column", self.struct, self._h, self._phi)
        self._find_power = instance.function("power", self.struct, self._h, self._phi, n, self._rates)

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

    def power(self, mu: Vector, acceleration: float | None = None) -> float:
        """Return dH/dt at fixed (Q, psi) for M_J^-1 H_h, with an acceleration or that of the motion."""
        self._find_power(mu)
        rate, by_acceleration = map(float, self._rates)
        return rate + (float(self._motion.rates[2]) if acceleration is None else acceleration) * by_acceleration


def _rate(e: Any) -> Statements:
    return {"value": e.diff(named("rate")).diff(named("dt")).subs(named("dt"), 0)}


def _flux(e: Any) -> Statements:
    flux, slope = e.diff(named("by_cells")), named("psi", 0)
    return {"value": flux, "by_psi_0": flux.diff(slope), "by_h": flux.diff(named("f0"))}


def _end(e: Any) -> Statements:
    flux = e.diff(named("by_levels"))
    return {"value": flux, "by_value": flux.diff(named("u")), "by_h": flux.diff(named("f0"))}
