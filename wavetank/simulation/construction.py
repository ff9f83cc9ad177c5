"""From a case to the tank: footprint, walls, water, sponge, absorbing paddles and initial state."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from pydantic import ValidationError

from wavetank.arrays import Vector
from wavetank.case import (
    BasinTank,
    Case,
    EndWall,
    Physics,
    PistonWall,
    PythonBed,
    RingTank,
    RunState,
    SliceTank,
)
from wavetank.case.initial import FileSurface, FormulaSurface
from wavetank.case.output import FAR
from wavetank.case.tank import AnySponge, EndSponge, FormulaSponge, GroupSponge
from wavetank.case.wall import ActiveAbsorption, MovingWall, ShapedWall, SpringDamper
from wavetank.errors import InputError
from wavetank.fem.by_place import at_the_same, found, gathered
from wavetank.fem.layout_mesh import draw_layout, read_layout
from wavetank.fem.plane import Plane
from wavetank.fem.points import Points
from wavetank.mesh import MeshFile, Rectangle
from wavetank.motion import Motion
from wavetank.motion.feedback import FeedbackMotion, FeedbackState, StateSpaceFilter, elevation_at_face
from wavetank.motion.motion import STEEPEST, Tangent
from wavetank.mpi import from_first, raise_on_all_ranks
from wavetank.output.checkpoint import Checkpoint, checked_tree, is_at, read_checkpoint_file, readable_checkpoints
from wavetank.output.directory import RunDirectory
from wavetank.simulation.supply import PaddleWork
from wavetank.state import Held, deserialize, typed
from wavetank.tank.answering import AnsweringPaddle, Excess, Look, Push
from wavetank.tank.bed import FlatBed, VaryingBed
from wavetank.tank.dissipation import checked, distance_from_edge, profile, width_of
from wavetank.tank.footprint import Basin, Ring, Slice
from wavetank.tank.kinematics import LinearRates, MovingWater, NonlinearRates
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import BothEnds, LinearEnds, LinearPaddle, Piston, Placed, Polynomial, Shaped, Side, StillWall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.values.case_model import CaseError, CaseModel, Problem, about, entry, renamed

Footprint = Slice | Ring | Basin


def build_footprint(scene: Case, comm: MPI.Comm) -> Footprint:
    """Return the tank seen from above; collective. Raises ``InputError`` for a mesh that cannot be used."""
    return entry(FOOTPRINTS, scene.tank, f"FOOTPRINTS of {__file__}")(scene, scene.tank, comm)


def _slice(scene: Case, tank: SliceTank, comm: MPI.Comm) -> Slice:
    return Slice(tank.length, scene.cells, comm=comm)


def _ring(scene: Case, tank: RingTank, comm: MPI.Comm) -> Ring:
    return Ring(tank.length, scene.cells, comm=comm)


def _basin(scene: Case, tank: BasinTank, comm: MPI.Comm) -> Basin:
    layout, size = tank.layout, scene.cell_size
    if isinstance(layout, MeshFile):
        return Basin(read_layout(Path(layout.file), comm))
    far = layout.box[2] if isinstance(layout, Rectangle) else None
    return Basin(draw_layout(lambda: layout.draw(size), comm), far=far)


FOOTPRINTS: dict[type[CaseModel], Callable[[Case, Any, MPI.Comm], Footprint]] = {
    SliceTank: _slice,
    RingTank: _ring,
    BasinTank: _basin,
}


MISSED = 0.1  # of the largest share: a polynomial farther from a shape is another
FLAT = 1e-9  # of the depth


class Kind(NamedTuple):
    """A kind of wall.

    Attributes
    ----------
    wall
        Its class, which says in words what it adds and how it maps.
    build
        Returns the wall at an end of the tank, by its table, on a footprint with its plane; collective.
    """

    wall: type[Placed]
    build: Callable[[EndWall, Any, Any, Plane], Any]


def build_wall(scene: Case, footprint: Footprint, plane: Plane) -> Any:
    """Return what moves of the scene's walls, for its water; collective.

    Raises ``InputError`` where one cannot move as far.
    """
    walls = [_built(seen, footprint, plane) for seen in scene.paddles]
    if len(walls) < 2:
        return walls[0] if walls else StillWall()
    return LinearEnds(*walls) if scene.physics == "linear" else _both(scene, *walls, plane=plane)


def kinds_of(scene: Case) -> list[type[Placed]]:
    """Return the classes of what moves of the scene's walls, or that of one that stands still."""
    return [_kind(seen).wall for seen in scene.paddles] or [StillWall]


def _kind(end: EndWall) -> Kind:
    return entry(WALLS[end.case.physics], end.wall, f"WALLS of {__file__}")


def _built(end: EndWall, footprint: Footprint, plane: Plane) -> Any:
    """Return the wall at an end of the tank; collective."""
    with renamed("wall", end.key):
        return _kind(end).build(end, end.wall, footprint, plane)


def _both(scene: Case, near: Piston, far: Piston, *, plane: Plane) -> BothEnds:
    """Return both walls; raises ``CaseError`` where their reaches meet on a mesh of few cells."""
    if near.reach + far.reach > scene.tank.length * (1 + 1e-9):
        what = f"reaches {far.reach:.4g} m on this mesh, the wall {near.reach:.4g} m: must not overlap"
        raise CaseError([Problem(("far_wall", "reach"), scene.ends[1].reach, what)])
    return BothEnds(near, far, plane=plane)


def motion_of(end: EndWall) -> Motion:
    """Return what moves the wall: of a paddle that absorbs a motion of this run's own."""
    return end.motion() if getattr(end.wall, "absorb", None) is None else FeedbackMotion(end.motion())


def _linear_piston(end: EndWall, noun: PistonWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    return LinearPaddle(motion_of(end), plane=plane, side=footprint.side(end.side))


def _linear_shaped(end: EndWall, noun: ShapedWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    side, shape = footprint.side(end.side), _shape(end, noun, plane)
    return LinearPaddle(motion_of(end), plane=plane, side=side, shape=shape)


def _shape(end: EndWall, noun: ShapedWall, plane: Plane) -> Polynomial:
    """Return the polynomial of a paddle's shape; raises ``CaseError`` for one that it would not show."""
    wavemaker, depth = noun.wavemaker, end.tank.depth
    shape = Polynomial.near(lambda z: wavemaker.mode_shape(z, depth), depth, plane.mesh, kinks=wavemaker.kinks(depth))
    z = np.linspace(-depth, 0.0, 1001, dtype=np.float64)
    wanted = wavemaker.mode_shape(z, depth)
    missed = float(np.abs(shape.at(z) - wanted).max() / np.abs(wanted).max())
    if missed > MISSED:
        allowed = f"bends the paddle too sharply: the nearest polynomial misses {100 * missed:.0f} % of its stroke"
        raise CaseError([Problem(("wall", noun.shaped_by), getattr(noun, noun.shaped_by), allowed)])
    return shape


def _shaped(end: EndWall, noun: ShapedWall, footprint: Slice | Basin, plane: Plane) -> Piston:
    side, shape = footprint.side(end.side), _shape(end, noun, plane)
    wall = Shaped(motion_of(end), plane=plane, reach=_reach(end, noun, footprint, side), side=side, shape=shape)
    _check_flat(end, noun, wall, plane)
    return _checked(end, noun, wall)


def _check_flat(end: EndWall, noun: ShapedWall, wall: Piston, plane: Plane) -> None:
    """Raise ``CaseError`` for a bed that varies within the reach of a paddle that leans; collective."""
    depth, distances = end.case.depths(), wall.distances(plane)
    if not callable(depth):
        return
    result = raise_on_all_ranks(plane.comm, lambda: np.asarray(depth(*plane.places.T)))
    uneven = np.abs(result - end.tank.depth) > FLAT * end.tank.depth
    nearest = plane.comm.allreduce(float(distances[uneven].min(initial=np.inf)), op=MPI.MIN)
    if nearest < wall.reach:
        needed = STEEPEST * noun.max_mode_shape(end.tank) * end.max_displacement
        bounds = f"must be at most {nearest:.4g} m, and more than {needed:.4g} m for this motion"
        flat = f"must be of the tank's depth, to {FLAT:g} of it, within the reach of a paddle that leans"
        if noun.reach is not None and nearest > needed:
            raise CaseError([Problem(("wall", "reach"), noun.reach, f"{bounds}: the bed {flat}")])
        cure = f"its reach {bounds}"
        if nearest <= needed:
            cure = f"this motion needs more than {needed:.4g} m of such a bed; a piston needs none"
        here = f"here {wall.reach:.4g} m{'' if noun.reach else ' by default'}, and is so for {nearest:.4g} m"
        raise CaseError([Problem(("tank", "bed"), None, f"{flat}, {here}: {cure}")])


def _piston(end: EndWall, noun: MovingWall, footprint: Slice | Basin, plane: Plane) -> Piston:
    side = footprint.side(end.side)
    wall = Piston(motion_of(end), plane=plane, reach=_reach(end, noun, footprint, side), side=side)
    return _checked(end, noun, wall)


def _checked(end: EndWall, noun: MovingWall, wall: Piston) -> Piston:
    """Return the wall; raises ``CaseError`` where it goes farther than its mapping can."""
    excursion, allowed = noun.max_mode_shape(end.tank) * end.max_displacement, wall.largest_stroke
    if excursion >= allowed:
        limit = (
            f"goes {excursion:.4g} m from rest; must stay below {allowed:.4g} m, 3/4 of the reach in which its mapping "
            f"dies out, which is {wall.reach:.4g} m on this mesh and before any wall that stands still"
        )
        raise CaseError([Problem(("wall", "motion"), None, limit)])
    return wall


def _reach(end: EndWall, noun: MovingWall, footprint: Slice | Basin, side: Side) -> float:
    """Return where the wall's mapping has died out [m], before any wall that must not move; collective."""
    free, asked = footprint.free_reach(side), end.reach
    if noun.reach is not None and asked > free * (1 + 1e-9):
        what = "where a wall stands that does not run along the paddle's motion"
        raise CaseError([Problem(("wall", "reach"), asked, f"must be at most {free:.4g} m, {what}")])
    return min(free, asked)


WALLS: dict[Physics, dict[type[CaseModel], Kind]] = {  # by the nearest base class of a wall's table
    "nonlinear": {MovingWall: Kind(Piston, _piston), ShapedWall: Kind(Shaped, _shaped)},
    "linear": {MovingWall: Kind(LinearPaddle, _linear_piston), ShapedWall: Kind(LinearPaddle, _linear_shaped)},
}


AnyWaves = NonlinearWaves | LinearWaves
NOMINAL = 0.01  # of the depth: what a bed may differ from it where waves are made, as measured ones do


def build_waves(scene: Case, comm: MPI.Comm) -> AnyWaves:
    """Return the tank with its water; collective."""
    return fill(scene, build_footprint(scene, comm))


def fill(scene: Case, footprint: Footprint) -> AnyWaves:
    """Return a footprint with the scene's water in it; collective."""
    with about("tank", "bed"):
        plane = Plane(footprint.mesh, scene.numerics.order, footprint.chart, walls=footprint.facets_of)
        check_depth(scene, footprint, plane)
        return WATERS[scene.physics].build(scene, footprint, plane)


def check_depth(scene: Case, footprint: Footprint, plane: Plane) -> None:
    """Raise ``CaseError`` if the tank's depth is not the bed's at the paddle, or is nowhere its; collective."""
    depth = scene.depths()
    if not callable(depth):
        return
    looked_at = {"a depth of the bed": plane.places}
    if not isinstance(footprint, Ring) and scene.paddles:
        ends = {seen.side: plane.places[plane.at(footprint.side(seen.side).facets)] for seen in scene.paddles}
        looked_at = {f"the bed's depth at the {end}": places for end, places in ends.items()}
    for where, at in looked_at.items():
        result = raise_on_all_ranks(plane.comm, lambda at=at: depth(*at.T))  # type: ignore[misc]
        low = plane.comm.allreduce(float(np.min(result, initial=np.inf)), op=MPI.MIN)
        high = plane.comm.allreduce(float(np.max(result, initial=-np.inf)), op=MPI.MAX)
        if low > 0.0 and not (1 - NOMINAL) * low <= scene.tank.depth <= (1 + NOMINAL) * high:
            depths = f"{low:.4g} m" if f"{low:.4g}" == f"{high:.4g}" else f"{low:.4g} to {high:.4g} m"
            or_else = ", or the bed of the tank's depth there: the wall moves" if where.endswith(FAR) else ""
            allowed = f"must be {where}, {depths}, to 1 %{or_else}"
            raise CaseError([Problem(("tank", "depth"), scene.tank.depth, allowed)])


def told_of_bed(scene: Case, waves: AnyWaves) -> str:
    """Return how much of the tank the bed's minimum depth touches, or nothing if it has none; collective."""
    minimum = None if scene.tank.bed is None else scene.tank.bed.minimum_depth
    if minimum is None:
        return ""
    touched = np.asarray(waves.bed.still == minimum, dtype=np.float64)
    wet, whole = (waves.plane.sum(waves.mass.apply(part)) for part in (touched, np.ones_like(touched)))
    return f"tank.bed.minimum_depth = {minimum:g} m holds for {100 * wet / whole:.3g} % of the tank"


def bed_by_code(scene: Case, waves: AnyWaves) -> dict[str, Vector]:
    """Return x, y (of a basin) [m] and depth [m] of a bed by a Python function at all degrees of freedom; collective.

    Empty of any other bed, and on all ranks but the first.
    """
    depth = scene.depths()
    if not isinstance(scene.tank.bed, PythonBed) or not callable(depth):
        return {}
    x, y = waves.plane.places.T
    columns = {"x [m]": x, "y [m]": y, "depth [m]": raise_on_all_ranks(waves.plane.comm, lambda: depth(x, y))}
    if waves.plane.mesh.topology.dim == 1:
        del columns["y [m]"]
    values, _ = gathered(waves.plane, [*columns.values()])
    return dict(zip(columns, values, strict=False))


def told_energy(scene: Case) -> list[str]:
    """Return a scene's Hamiltonian in words, a line each: its parts, the mapping, the bed; what vanishes, and why."""
    parts, walls = WATERS[scene.physics].waves.parts, kinds_of(scene)
    names = [seen.key.replace("_", " ") for seen in scene.paddles] or ["wall"]
    named = [wall.part._replace(name=name) for wall, name in zip(walls, names, strict=True)]
    if len(named) > 1 and named[0].formula == named[1].formula:
        named[1] = named[1]._replace(formula="the same at the far paddle")
    bed = FlatBed if scene.tank.bed is None else VaryingBed
    own = ["X_p: of each paddle its own, from its wall into the water"] if len(named) > 1 else []
    return [*map(str, (*parts, *named)), *dict.fromkeys(wall.told for wall in walls), *own, bed.told]


def _nonlinear(scene: Case, footprint: Footprint, plane: Plane) -> NonlinearWaves:
    numerics = scene.numerics
    return NonlinearWaves(
        plane,
        depth=scene.depths(),
        gravity=scene.tank.gravity,
        wall=build_wall(scene, footprint, plane),
        vertical_order=numerics.vertical_order,
        tolerances=Tolerances(stage=numerics.tolerance, interior=0.1 * numerics.tolerance),
    )


def _linear(scene: Case, footprint: Footprint, plane: Plane) -> LinearWaves:
    return LinearWaves(
        plane,
        depth=scene.depths(),
        gravity=scene.tank.gravity,
        wall=build_wall(scene, footprint, plane),
        vertical_order=scene.numerics.vertical_order,
        tolerance=scene.numerics.tolerance,
    )


def moving_water(scene: Case, waves: AnyWaves) -> MovingWater:
    """Return water of an observer's own like the scene's, of which rates are found; collective."""
    numerics = scene.numerics
    if isinstance(waves, LinearWaves):
        return LinearRates(waves, tolerance=0.1 * numerics.tolerance)
    tangents = [Tangent(paddle.motion) for paddle in waves.wall.paddles]
    return NonlinearRates(
        waves.plane,
        tangents=tangents,
        depth=scene.depths(),
        gravity=scene.tank.gravity,
        wall=waves.wall.moved_by(tangents),
        vertical_order=numerics.vertical_order,
        tolerances=Tolerances(stage=numerics.tolerance, interior=0.1 * numerics.tolerance),
    )


class Water(NamedTuple):
    """A kind of water: the class of its waves, and what builds them."""

    waves: type[NonlinearWaves] | type[LinearWaves]
    build: Callable[[Case, Footprint, Plane], AnyWaves]


WATERS: dict[Physics, Water] = {
    "nonlinear": Water(NonlinearWaves, _nonlinear),
    "linear": Water(LinearWaves, _linear),
}


def build_sponge(scene: Case, sponge: AnySponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    """Return gamma at the owned degrees of freedom [1/s], shape (owned,); collective."""
    return entry(SPONGES, sponge, f"SPONGES of {__file__}")(scene, sponge, footprint, waves)


def told_of_sponge(scene: Case, waves: AnyWaves) -> str:
    """Return where the sponge is, and the largest rate that acts, or nothing if there is none; collective."""
    if scene.sponge is None or waves.damping is None:
        return ""
    most = waves.plane.comm.allreduce(float(np.max(waves.damping, initial=0.0)), op=MPI.MAX)
    where = f"the last {scene.sponge.length:g} m, " if isinstance(scene.sponge, EndSponge) else ""
    return f"sponge: {where}up to {most:.3g} 1/s"


def _formula(scene: Case, sponge: FormulaSponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    plane = waves.plane
    return checked(plane, raise_on_all_ranks(plane.comm, lambda: sponge.build()(*plane.places.T)))


def _group(scene: Case, sponge: GroupSponge, footprint: Basin, waves: AnyWaves) -> Vector:
    distance = distance_from_edge(waves.plane, footprint.layout.cells_of("sponge"))
    return _profile(scene, sponge, distance, width=width_of(waves.plane, distance))


def _end(scene: Case, sponge: EndSponge, footprint: Footprint, waves: AnyWaves) -> Vector:
    x = waves.wall.distances(waves.plane)
    far = waves.plane.comm.allreduce(float(np.max(x, initial=-np.inf)), op=MPI.MAX)
    return _profile(scene, sponge, np.asarray(x - (far - sponge.length)), width=sponge.length)


def _profile(scene: Case, sponge: EndSponge | GroupSponge, distance: Vector, *, width: float) -> Vector:
    """Return gamma at distances from the inner edge of a sponge of some width [m]."""
    strength = sponge.strength_for(width, scene.tank, paddle=scene.ends[0].period)
    return profile(distance, width=width, strength=strength)


SPONGES: dict[type[CaseModel], Callable[[Case, Any, Any, AnyWaves], Vector]] = {
    FormulaSponge: _formula,
    GroupSponge: _group,
    EndSponge: _end,
}


Answered = tuple[StateSpaceFilter, Look]


def build_answers(scene: Case, waves: AnyWaves) -> list[AnsweringPaddle]:
    """Return what answers the water, of each paddle of a scene that absorbs; collective."""
    result = list[AnsweringPaddle]()
    for number in scene.absorbing:
        seen = scene.paddles[number]
        wall: Any = seen.wall
        paddle: Any = waves.wall.paddles[number]
        equation, look = entry(ANSWERS, wall.absorb, f"ANSWERS of {__file__}")(scene, number, waves)
        shares = wall.mode_shape(seen.tank)
        result.append(AnsweringPaddle(paddle, equation, look, shares=shares, key=seen.key))
    return result


def build_paddle_work(scene: Case, waves: AnyWaves) -> PaddleWork | None:
    """Return what counts the work of a scene's paddles, where some of them absorb."""
    if not scene.absorbing:
        return None
    walls: list[Any] = [seen.wall for seen in scene.paddles]
    masses = np.array([wall.added_mass(scene.tank) for wall in walls])
    return PaddleWork([paddle.motion for paddle in waves.wall.paddles], masses)


def went_on(scene: Case, motions: Iterable[Any], parts: Held) -> None:
    """Move paddles with feedback to where the parts of a run have them, among the motions of all paddles."""
    paddles = [*motions]
    for n, number in enumerate(scene.absorbing):
        state = typed(FeedbackState, parts[f"paddle {n}"]["motion"], f"paddle {n}.motion")
        paddles[number].state = replace(state, retained={})


def _active(scene: Case, number: int, waves: AnyWaves) -> Answered:
    seen, tank, comm = scene.paddles[number], scene.tank, waves.plane.comm
    wall: Any = seen.wall
    paddle: Any = waves.wall.paddles[number]
    result = from_first(comm, lambda: wall.absorb.build(tank, wall.wavemaker, paddles=scene.paddle_periods))
    above, below = result.over_s()
    made = raise_on_all_ranks(
        comm,
        lambda: elevation_at_face(
            seen.motion(), wall.wavemaker, depth=tank.depth, gravity=tank.gravity, duration=scene.run.duration
        ),
    )
    excess = Excess(waves, paddle, made)
    return StateSpaceFilter.of_transfer(-above, below).with_feedthrough(excess.rise), excess


def _on_spring(scene: Case, number: int, waves: AnyWaves) -> Answered:
    wall: Any = scene.paddles[number].wall
    paddle: Any = waves.wall.paddles[number]
    mass, stiffness, damping = wall.absorb.resolved(scene.tank, wall.wavemaker, paddles=scene.paddle_periods)
    added = wall.added_mass(scene.tank)
    equation = StateSpaceFilter.of_spring(mass + added, stiffness, damping)
    return equation, Push(waves, number, paddle, mass=added)


ANSWERS: dict[type[CaseModel], Callable[[Case, int, AnyWaves], Answered]] = {
    ActiveAbsorption: _active,
    SpringDamper: _on_spring,
}


TRIALS = 6  # each ten times as near: the slopes of surface and paddle are a few tenths at most


class KeptSurface(NamedTuple):
    """The surface of a run, by place.

    Attributes
    ----------
    scene
        What was computed, with its numerics.
    t
        The time [s].
    mass
        Of the water [m³, m²].
    values
        Elevation [m] and surface potential [m²/s], shape (N,) each; used of the first rank alone.
    places
        Of the degrees of freedom in its mesh [m], shape (N, 3); used of the first rank alone.
    parts
        State of the parts of the run, paddles with feedback among them.
    """

    scene: Case
    t: float
    mass: float
    values: tuple[Vector, Vector]
    places: Vector
    parts: Held

    def on(self, waves: AnyWaves) -> tuple[Vector, Vector]:
        """Return both at the degrees of freedom of waves, whose wall stands as it will, shape (owned,); collective.

        On a mesh with others than those they are what the elements say there.
        """
        if at_the_same(waves.plane, self.places):
            elevation, potential = found(waves.plane, self.values, self.places)
            return elevation, potential
        comm, footprint = waves.plane.comm, build_footprint(self.scene, waves.plane.comm)
        plane = Plane(footprint.mesh, self.scene.numerics.order, footprint.chart)
        wall: Any = build_wall(self.scene, footprint, plane)
        went_on(self.scene, (paddle.motion for paddle in wall.paddles), self.parts)
        if wall.moves:
            wall.set_time(self.t)
        fields = [plane.function("kept") for _ in self.values]
        for field, values in zip(fields, found(plane, self.values, self.places), strict=True):
            field.set(values)
        reference = _on_all(comm, waves.plane.places)

        def coordinates(z: Vector) -> Vector:
            return plane.chart.place(wall.to_reference(waves.wall.to_physical(reference, z), z))

        z: Vector = np.zeros(len(reference))
        points = Points(plane, coordinates(z))
        for _ in range(TRIALS if wall.leans or waves.wall.leans else 1):  # where the surface is depends on its height
            points.move(coordinates(z))
            z = points.evaluate(fields[0])
        begin = sum(comm.allgather(waves.plane.owned)[: comm.rank])
        mine = slice(begin, begin + waves.plane.owned)
        return z[mine], points.evaluate(fields[1])[mine]


def _on_all(comm: MPI.Comm, rows: Vector) -> Vector:
    """Return all ranks' rows, one rank's after another's; collective."""
    return np.concatenate(comm.allgather(rows))


SEEN = 0.01  # of its rms: a mean elevation that is told
APART = 1e-3  # of the depth: so far may the wall stand from where it stood
MESHED = {"cells", "geometry", "sponge_length", "factor", "refine", "file"}  # of a layout: its mesh, not its walls


def initial_surface(scene: Case, waves: AnyWaves) -> tuple[Vector, Vector]:
    """Return eta [m] and psi [m²/s] at the degrees of freedom, shape (owned,); collective.

    Raises ``InputError`` where they cannot be had.
    """
    comm, initial = waves.plane.comm, scene.initial
    if isinstance(initial, RunState):
        return kept_surface(scene, initial, waves).on(waves)
    x, y = waves.plane.places.T
    return raise_on_all_ranks(comm, lambda: initial.surface(scene.tank, x, y))


def kept_surface(scene: Case, initial: RunState, waves: AnyWaves) -> KeptSurface:
    """Return what was kept, values on the first rank alone; collective. Raises ``InputError``, on all ranks."""
    comm = waves.plane.comm
    result: list[Checkpoint] = []

    def read() -> tuple[dict[str, Any], Case, Held]:
        path, about = _chosen(initial)
        before, checkpoint = _its_scene(initial, about), read_checkpoint_file(path)
        if not isinstance(checkpoint, Checkpoint):
            raise InputError(f"{path}: cannot be used ({checkpoint or 'it is no longer there'}).")
        try:
            tree = checked_tree(checkpoint.about, checkpoint.held, [np.zeros(0)] * len(checkpoint.arrays))
        except ValueError as error:
            raise InputError(f"{path}: cannot be used ({error}).") from None
        scheme = tree["run"]["parts"]
        _check(scene, before, about["t"], scheme)
        result.append(checkpoint)
        return about, before, scheme

    about, before, scheme = from_first(comm, read)
    values: tuple[Vector, Vector] = np.zeros(0), np.zeros(0)
    places: Vector = np.zeros((0, 3))
    if result:
        surface = deserialize(result[0].held, result[0].arrays)["surface"]
        values, places = (surface["elevation"], surface["potential"]), result[0].places
    return KeptSurface(before, about["t"], about["mass"], values, places, parts=scheme)


def with_its_numerics(scene: Case, initial: RunState) -> Case:
    """Return the scene with that run's numerics where it names none; or ``InputError``, also if they do not fit."""
    before = _its_scene(initial, _chosen(initial)[1])
    numerics = scene.numerics.over(before.numerics, named=scene.numerics.model_fields_set)
    result = scene.model_copy(update={"numerics": numerics})
    if problems := [*numerics.problems(result.ends[0])]:
        raise CaseError(problems)
    return result


def told_of_start(scene: Case, waves: AnyWaves, q: Vector) -> str:
    """Return what a start costs of the mass, of a file where its mean is, or nothing of others; collective."""
    initial = scene.initial
    if isinstance(initial, FileSurface | FormulaSurface):
        return _told_of_mean(waves, q)
    if not isinstance(initial, RunState):
        return ""
    about = from_first(waves.plane.comm, lambda: _chosen(initial)[1])
    mass = waves.total_mass(q) / about["mass"] - 1.0
    return f"begins with {initial.directory} at t = {about['t']:.6g} s; the mass changes by {mass:.1g} of it"


def _told_of_mean(waves: AnyWaves, q: Vector) -> str:
    """Return where the mean of an initial surface is, unless that is at still water; collective."""
    still, higher = (waves.total_mass(waves.state(np.full_like(q, eta), 0 * q)[0]) for eta in (0.0, waves.depth))
    mean = (waves.total_mass(q) - still) / (higher - still) * waves.depth
    if abs(mean) < SEEN * waves.plane.rms(waves.elevation(q, 0 * q, 0.0)):
        return ""
    return f"the initial surface has a mean of {mean:+.3g} m: at rest the water would stand there, not at z = 0"


def _chosen(initial: RunState) -> tuple[Path, dict[str, Any]]:
    """Return the file of the checkpoint that is asked for, and what is told of it; raises ``InputError``."""
    directory = RunDirectory(initial.directory)
    result = list(readable_checkpoints(directory.path))
    if not result:
        raise InputError(f"directory = {initial.directory}: holds no checkpoint to begin with.")
    if initial.t is None:
        return result[0]
    at = initial.t
    for path, description in result:
        if is_at(description, at):
            return path, description
    times = " and ".join(f"{about['t']:.6g} s" for _, about in result)
    raise InputError(f"t = {at:g}: must be a time that is kept, which are {times}; a run keeps its end.")


def _its_scene(initial: RunState, about: dict[str, Any]) -> Case:
    try:
        return Case.model_validate(about["chosen"])
    except (KeyError, ValidationError):
        raise InputError(f"directory = {initial.directory}: was written by another version of this program.") from None


def _check(scene: Case, before: Case, t: float, scheme: Held) -> None:
    """Raise ``InputError`` unless the tanks are one, and the walls stand in one place."""
    mine, its = (_walls(one) for one in (scene, before))
    for key in sorted(mine.keys() | its.keys()):
        if mine.get(key) != its.get(key):
            raise InputError(f"tank.{key} = {mine.get(key)!r}: must be {its.get(key)!r}, as in the run to begin with.")
    moved, moves = _motions(before, scheme), _motions(scene)
    for name, was, now in zip(("wall", "far wall"), before.ends, scene.ends, strict=True):
        places = [y for y in (one.wall.places(one.tank) for one in (was, now)) if y is not None]
        along = np.unique(np.concatenate(places)) if places else None
        stood, stands = _position(moved.get(was.key), t, along), _position(moves.get(now.key), 0.0, along)
        apart = stands - stood
        if np.abs(apart).max() > APART * scene.tank.depth:
            most = int(np.abs(apart).argmax())
            there, here = (np.broadcast_to(one, apart.shape).flat[most] for one in (stood, stands))
            where = f"the {name} stood at {there:.4g} m when t = {t:.6g} s, and begins at {here:.4g} m"
            raise InputError(f"{where}: must be as near as {APART:g} of the depth; it may wait until it is at rest.")


def _walls(scene: Case) -> dict[str, Any]:
    """Return what there is to say of a tank, without its mesh, by keys."""
    return dict(_leaves(scene.tank.model_dump(mode="json")))


def _leaves(tables: dict[str, Any], name: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{name}{key}.")
        elif not (name.startswith("layout.") and key in MESHED):
            yield f"{name}{key}", value


def _motions(scene: Case, scheme: Held | None = None) -> dict[str, Motion]:
    """Return what moves the walls, as the water has it, by their keys; ``scheme``: where absorbing has taken them."""
    if scene.physics == "linear":
        return {}
    motions = [motion_of(seen) for seen in scene.paddles]
    if scheme is not None:
        went_on(scene, motions, scheme)
    return {seen.key: motion for seen, motion in zip(scene.paddles, motions, strict=True)}


def _position(motion: Motion | None, t: float, y: Vector | None) -> Vector:
    """Return where a motion is [m], at places along it or, as a whole, at one; without one at rest."""
    return np.zeros(1) if motion is None else np.atleast_1d(motion.position(t, y)).ravel()
