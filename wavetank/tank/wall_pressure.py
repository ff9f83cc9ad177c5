"""Pressure of the water on walls: forces, their moments, and the force and power of a paddle.

    force = int p n dS,   n dS = J F^-T N dzeta h dX

on the wall, with N out of the water in the reference tank and the matrix F of the mapping (Nanson's formula). The
pressure is that of ``kinematics.py``. The velocity across a wall equals that of the wall to the order p of the
elements;
the square of its error enters the pressure.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import mesh
from ufl.constantvalue import Zero

from wavetank.base.arrays import Vector
from wavetank.fem.forms import ScalarForm
from wavetank.fem.plane import Plane
from wavetank.fem.points import Cells
from wavetank.tank.kinematics import Kinematics, MovingWater
from wavetank.tank.walls import LinearPaddle, Paddle, Polynomial

RINGS = 1  # rings of cells around those at a wall


class Load(NamedTuple):
    """The load of the water on a wall, in a slice per width.

    Attributes
    ----------
    force
        Force along x, y and z [N, N/m], shape (3,).
    moment
        Moment about the axes along x, y and z through a point [N m, N], shape (3,).
    """

    force: Vector
    moment: Vector


class WallPressure:
    """The pressure on some walls.

    Parameters
    ----------
    walls
        Facet tags of each wall, with 1 at the wall.
    density
        Density of the water [kg/m³].

    Attributes
    ----------
    plane
        Horizontal space.
    """

    def __init__(self, water: MovingWater, walls: Sequence[mesh.MeshTags], *, density: float):
        self._water, self._density, self.plane = water, density, water.plane
        plane = water.plane
        self._kinematics = Kinematics(water, plane.neighbourhood(_cells_at(plane, walls), rings=RINGS))
        self._spread = plane.layered_function(water.vertical.n + 1, "pressure at the levels")
        self._forces = [self._forms(facets) for facets in walls]
        self._pressure: Vector = np.zeros(0)

    def _forms(self, facets: mesh.MeshTags) -> list[ScalarForm | None]:
        """Return the forms of the forces along x, y and z; None for a vanishing force."""
        water, plane = self._water, self._water.plane
        (h, d, mapping), out = (
            (water.h.function, water.waves.bed.d, water.densities.mapping),
            ufl.FacetNormal(plane.mesh),
        )
        forces: list[Any] = [ufl.as_ufl(0), ufl.as_ufl(0), ufl.as_ufl(0)]
        for k, (zeta, weight) in enumerate(zip(water.vertical.zeta, water.vertical.weights, strict=True)):
            z = float(zeta) * h - d
            along, rise = mapping.flow(out, ufl.as_ufl(0), h=h, z=z)
            part = float(weight) * mapping.J(z) * self._spread.function[k]
            for axis in range(plane.mesh.geometry.dim):
                forces[axis] += part * h * along[axis]
            forces[2] += part * rise  # contains the factor h
        on_it = ufl.ds(domain=plane.mesh, subdomain_data=facets)(1)
        return [None if isinstance(force, Zero) else ScalarForm(force * on_it, plane.comm) for force in forces]

    def find(self, q: Vector, p: Vector, t: float) -> None:
        """Compute the pressure of a state; collective."""
        water = self._water
        water.find_rates(q, p, t)
        self._pressure = -self._density * (self._kinematics.layers().head + water.waves.gravity * water.nodes[..., 2])

    def load(self, wall: int, about: Vector) -> Load:
        """Return the load of the pressure on one of the walls, with moments about a point (x, y, z) [m]; collective."""
        force, arms = self._force(wall, self._pressure), np.moveaxis(self._water.nodes - about, -1, 0)
        (_, x_y, x_z), (y_x, _, y_z), (z_x, z_y, _) = (self._force(wall, self._pressure * arm) for arm in arms)
        return Load(force, np.array([y_z - z_y, z_x - x_z, x_y - y_x]))

    def _force(self, wall: int, pressure: Vector) -> Vector:
        """Return the force along x, y and z, shape (3,), of a pressure of shape (levels, rows); collective."""
        self._spread.rows[:] = pressure.T
        return np.array([0.0 if form is None else form.assemble() for form in self._forces[wall]])

    def beyond_still_water(self, wall: int, shape: Polynomial, weights: Vector | float) -> Vector:
        """Return the force of the pressure times f(z) and weights, shape (rows,), beyond the static force; collective.

        The still-water part, int -rho g z f dz from the bed to z = 0, is subtracted uniformly from the bed to the
        surface.
        """
        zeta, z, vertical = self._kinematics.levels[:, None], self._water.nodes[..., 2], self._water.vertical
        h = self._water.h.rows[:, 0]
        below = (zeta - 1.0) * (zeta[0] * h - z[0])  # heights in still water
        weight = self._density * self._water.waves.gravity
        still = (zeta[0] * h - z[0]) * (vertical.weights @ (-weight * below * shape.at(below)))
        return self._force(wall, (self._pressure * shape.at(z) - still / h) * weights)


class PaddlePush:
    """Force and power of a paddle on the water, relative to still water, as in the energy budget.

    Parameters
    ----------
    wall
        Number of the wall.

    Attributes
    ----------
    y
        Positions along the paddle of all degrees of freedom of this rank and its ghosts [m], shape (rows,).
    """

    def __init__(self, pressure: WallPressure, wall: int, paddle: Paddle | LinearPaddle):
        self.pressure, self._wall, self._shape, self._motion = pressure, wall, paddle.shape, paddle.motion
        plane = pressure.plane
        self.y = paddle.side.along(plane.chart.places(plane.V.tabulate_dof_coordinates()))
        self._normal = np.append(paddle.side.normal, 0.0)

    def against(self, velocity: Vector | float) -> float:
        """Return the power [W] of a velocity X_p' [m/s] at ``y``; for 1 m/s the force conjugate to X_p [N].

        In a slice per width. Collective.
        """
        return -float(self.pressure.beyond_still_water(self._wall, self._shape, velocity) @ self._normal)

    def at(self, q: Vector, p: Vector, t: float) -> tuple[float, float]:
        """Return force [N, N/m] and power [W, W/m] at a state; collective."""
        self.pressure.find(q, p, t)
        return self.against(1.0), self.against(self._motion.velocity(t, self.y))


def _cells_at(plane: Plane, walls: Sequence[mesh.MeshTags]) -> Cells:
    """Return the cells of this rank at some walls."""
    topology = plane.mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    behind = topology.connectivity(topology.dim - 1, topology.dim)
    result = [behind.links(facet) for facets in walls for facet in facets.find(1)]
    cells: Cells = np.unique(np.concatenate([np.zeros(0, dtype=np.int32), *result]))
    return cells
