"""Construction of the tank of a case: footprint, walls, water, sponge, absorbing paddles and initial state."""

from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError, Problem, about
from wavetank.base.mpi import raise_on_all_ranks
from wavetank.case import (
    Case,
    PythonBed,
    RingTank,
    SliceTank,
)
from wavetank.case.output import FAR
from wavetank.case.tank import AnySponge, EndSponge, FormulaSponge, GroupSponge
from wavetank.fem.by_place import gathered
from wavetank.fem.layout_mesh import draw_layout, read_layout
from wavetank.fem.plane import Plane
from wavetank.integrators.wrappers import Filter
from wavetank.mesh import MeshFile, Rectangle
from wavetank.simulation.walls import Footprint, build_wall, wall_descriptions
from wavetank.tank.bed import FlatBed, VaryingBed
from wavetank.tank.breaking import BasinBreakingWatch, BreakingAlarm, BreakingDissipation, BreakingWatch
from wavetank.tank.dissipation import EdgePenalty, checked, distance_from_edge, profile
from wavetank.tank.footprint import Basin, Ring, Slice
from wavetank.tank.kinematics import LinearRates, MovingWater, NonlinearRates
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves, Tolerances


def build_footprint(case: Case, comm: MPI.Comm) -> Footprint:
    """Return the horizontal domain of the tank; collective. Raises ``InputError`` for a mesh that cannot be used."""
    tank = case.tank
    if isinstance(tank, SliceTank):
        return Slice(tank.length, case.cells, comm=comm)
    if isinstance(tank, RingTank):
        return Ring(tank.length, case.cells, comm=comm)
    layout, size = tank.layout, case.cell_size
    if isinstance(layout, MeshFile):
        return Basin(read_layout(Path(layout.file), comm))
    far = layout.box[2] if isinstance(layout, Rectangle) else None
    return Basin(draw_layout(lambda: layout.draw(size), comm), far=far)


AnyWaves = NonlinearWaves | LinearWaves
NOMINAL = 0.01  # tolerated difference between bed and depth at a paddle, relative to the depth


def build_waves(case: Case, comm: MPI.Comm) -> AnyWaves:
    """Return the tank with its water; collective."""
    return fill(case, build_footprint(case, comm))


def fill(case: Case, footprint: Footprint) -> AnyWaves:
    """Return the water of a case in a footprint; collective."""
    with about("tank", "bed"):
        plane = Plane(footprint.mesh, case.numerics.order, footprint.chart, walls=footprint.facets_of)
        check_depth(case, footprint, plane)
        numerics = case.numerics
        parts: dict[str, Any] = {
            "depth": case.depths(),
            "gravity": case.tank.gravity,
            "wall": build_wall(case, footprint, plane),
            "vertical_order": numerics.vertical_order,
        }
        if case.physics == "linear":
            return LinearWaves(plane, tolerance=numerics.tolerance, **parts)
        petsc = numerics.stage_solver == "petsc"
        tolerances = Tolerances(stage=numerics.tolerance, interior=0.1 * numerics.tolerance, petsc=petsc)
        return NonlinearWaves(plane, tolerances=tolerances, **parts)


def moving_water(case: Case, waves: AnyWaves) -> MovingWater:
    """Return the computation of the potential of a state and of its rate of change; collective."""
    if isinstance(waves, LinearWaves):
        return LinearRates(waves, tolerance=0.1 * case.numerics.tolerance)
    return NonlinearRates(waves)


def check_depth(case: Case, footprint: Footprint, plane: Plane) -> None:
    """Raise ``CaseError`` unless the bed has the tank's depth at its paddles or, without paddles, anywhere."""
    depth = case.depths()
    if not callable(depth):
        return
    depths_at = {"a depth of the bed": plane.places}
    if not isinstance(footprint, Ring) and case.paddles:
        ends = {one.side: plane.places[plane.at(footprint.side(one.side).facets)] for one in case.paddles}
        depths_at = {f"the bed's depth at the {end}": places for end, places in ends.items()}
    for where, at in depths_at.items():
        result = raise_on_all_ranks(plane.comm, lambda at=at: depth(*at.T))  # type: ignore[misc]
        low = plane.comm.allreduce(float(np.min(result, initial=np.inf)), op=MPI.MIN)
        high = plane.comm.allreduce(float(np.max(result, initial=-np.inf)), op=MPI.MAX)
        if low > 0.0 and not (1 - NOMINAL) * low <= case.tank.depth <= (1 + NOMINAL) * high:
            depths = f"{low:.4g} m" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g} m"
            or_else = ", or the bed must have the tank's depth at the moving wall" if where.endswith(FAR) else ""
            allowed = f"must be {where}, {depths}, to 1 %{or_else}"
            raise CaseError([Problem(("tank", "depth"), case.tank.depth, allowed)])


def bed_message(case: Case, waves: AnyWaves) -> str:
    """Return the part of the tank where the bed has its minimum depth; empty without a minimum depth; collective."""
    minimum = None if case.tank.bed is None else case.tank.bed.minimum_depth
    if minimum is None:
        return ""
    touched = np.asarray(waves.bed.still == minimum, dtype=np.float64)
    wet, total = (waves.plane.sum(waves.mass.apply(part)) for part in (touched, np.ones_like(touched)))
    return f"tank.bed.minimum_depth = {minimum:g} m applies to {100 * wet / total:.3g} % of the tank"


def bed_by_code(case: Case, waves: AnyWaves) -> dict[str, Vector]:
    """Return x, y (in a basin) [m] and depth [m] at all degrees of freedom, for a bed by a Python function; collective.

    Empty for any other bed, and except on the first rank.
    """
    depth = case.depths()
    if not isinstance(case.tank.bed, PythonBed) or not callable(depth):
        return {}
    x, y = waves.plane.places.T
    columns = {"x [m]": x, "y [m]": y, "depth [m]": raise_on_all_ranks(waves.plane.comm, lambda: depth(x, y))}
    if waves.plane.mesh.topology.dim == 1:
        del columns["y [m]"]
    values, _ = gathered(waves.plane, [*columns.values()])
    return dict(zip(columns, values, strict=False))


def describe_energy(case: Case) -> list[str]:
    """Return a description of a case's Hamiltonian in lines: its parts, mapping and bed, and the terms that vanish."""
    waves: type[AnyWaves] = LinearWaves if case.physics == "linear" else NonlinearWaves
    parts, mappings = zip(*wall_descriptions(case), strict=True)
    names = [one.key.replace("_", " ") for one in case.paddles] or ["wall"]
    named = [part._replace(name=name) for part, name in zip(parts, names, strict=True)]
    if len(named) > 1 and named[0].formula == named[1].formula:
        named[1] = named[1]._replace(formula="the same at the far paddle")
    bed = FlatBed if case.tank.bed is None else VaryingBed
    own = ["X_p: displacement of each paddle, from its wall into the water"] if len(named) > 1 else []
    return [
        *map(str, (*waves.parts, *named)),
        *dict.fromkeys(mappings),
        *own,
        bed.description,
    ]


def build_sponge(case: Case, sponge: AnySponge, footprint: Any, waves: AnyWaves) -> Vector:
    """Return gamma at the owned degrees of freedom [1/s], shape (owned,); collective."""
    plane = waves.plane
    if isinstance(sponge, FormulaSponge):
        return checked(plane, raise_on_all_ranks(plane.comm, lambda: sponge.build()(*plane.places.T)))
    if isinstance(sponge, GroupSponge):
        distance, width = distance_from_edge(plane, footprint.layout.cells_of("sponge"))
    else:
        x, width = waves.wall.distances(plane), sponge.length
        far = plane.comm.allreduce(float(np.max(x, initial=-np.inf)), op=MPI.MAX)
        distance = np.asarray(x - (far - width))
    strength = sponge.strength_for(width, case.tank, paddle=case.ends[0].period)
    return profile(distance, width=width, strength=strength)


def sponge_message(case: Case, waves: AnyWaves) -> str:
    """Return position and largest damping rate of the sponge; empty without a sponge; collective."""
    if case.sponge is None or waves.damping is None:
        return ""
    most = waves.plane.comm.allreduce(float(np.max(waves.damping, initial=0.0)), op=MPI.MAX)
    where = f"the last {case.sponge.length:g} m, " if isinstance(case.sponge, EndSponge) else ""
    return f"sponge: {where}up to {most:.3g} 1/s"


def build_filters(case: Case, waves: AnyWaves, dt: float) -> list[Filter]:
    """Return the filters between steps: breaking dissipation and the gradient-jump penalty; collective."""
    if isinstance(waves, LinearWaves):
        return []  # linear waves neither break nor have a current
    flow, filters = waves.surface, list[Filter]()
    if case.run.on_breaking != "ignore":
        length = case.tank.length if isinstance(case.tank, RingTank) else None
        along = isinstance(flow, SurfaceFlow)
        watch = BreakingWatch(waves, flow, length=length) if along else BasinBreakingWatch(waves, flow)
        if case.run.on_breaking == "dissipate":
            filters.append(BreakingDissipation(waves, watch, dt=dt))
        else:
            filters.append(BreakingAlarm(watch, stop=case.run.on_breaking == "stop"))
    if case.numerics.edge_penalty > 0:
        size, strength = waves.plane.cell_size, case.numerics.edge_penalty
        filters.append(EdgePenalty(waves, flow, cell_size=size, dt=dt, strength=strength))
    return filters
