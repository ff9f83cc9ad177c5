"""Initial surface of a case: from a formula, a file, or the state of another run."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import ValidationError

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError
from wavetank.base.errors import InputError
from wavetank.base.mpi import from_first, raise_on_all_ranks
from wavetank.base.state import StateTree, deserialize
from wavetank.case import Case, RunState
from wavetank.case.initial import FileSurface, FormulaSurface
from wavetank.fem.by_place import at_dofs, has_places
from wavetank.fem.plane import Plane
from wavetank.fem.points import Points
from wavetank.motion import Motion
from wavetank.output.checkpoint import (
    UNREADABLE,
    Checkpoint,
    checked_tree,
    is_at,
    read_checkpoint_file,
    readable_checkpoints,
)
from wavetank.output.directory import RunDirectory
from wavetank.simulation.construction import AnyWaves, build_footprint
from wavetank.simulation.feedback import restore_paddles
from wavetank.simulation.walls import build_wall, motion_of

TRIALS = 6  # fixed-point iterations, each ten times as exact: slopes of surface and paddle are a few tenths


class StoredSurface(NamedTuple):
    """The surface of a run in a checkpoint.

    Attributes
    ----------
    case
        Case of the run, with its numerics.
    t
        Time [s].
    mass
        Mass of the water [m³, m²].
    values
        Elevation [m] and surface potential [m²/s], shape (N,) each; used on the first rank only.
    places
        Positions of the degrees of freedom in its mesh [m], shape (N, 3); used on the first rank only.
    parts
        State of the parts of the run, including paddles with feedback.
    step
        Number of steps of the run.
    """

    case: Case
    t: float
    mass: float
    values: tuple[Vector, Vector]
    places: Vector
    parts: StateTree
    step: int = 0

    @classmethod
    def of(cls, case: Case, about: dict[str, Any], parts: StateTree, checkpoint: Checkpoint | None) -> Self:
        """Return the surface of a checkpoint, given its description; only the first rank has the checkpoint."""
        values: tuple[Vector, Vector] = np.zeros(0), np.zeros(0)
        places: Vector = np.zeros((0, 3))
        if checkpoint is not None:
            surface = deserialize(checkpoint.tree_json, checkpoint.arrays)["surface"]
            values, places = (surface["elevation"], surface["potential"]), checkpoint.places
        return cls(case, about["t"], about["mass"], values, places, parts, about["step"])

    def on(self, waves: AnyWaves) -> tuple[Vector, Vector]:
        """Return elevation and potential at the degrees of freedom of waves, shape (owned,); collective.

        The wall of the waves must be at its initial position. On another mesh the values are interpolated.
        """
        if has_places(waves.plane, self.places):
            elevation, potential = at_dofs(waves.plane, self.values, self.places)
            return elevation, potential
        comm, footprint = waves.plane.comm, build_footprint(self.case, waves.plane.comm)
        plane = Plane(footprint.mesh, self.case.numerics.order, footprint.chart)
        wall: Any = build_wall(self.case, footprint, plane)
        restore_paddles(self.case, (paddle.motion for paddle in wall.paddles), self.parts)
        if wall.moves:
            wall.set_time(self.t)
        fields = [plane.function("stored") for _ in self.values]
        for field, values in zip(fields, at_dofs(plane, self.values, self.places), strict=True):
            field.set(values)
        reference = np.concatenate(comm.allgather(waves.plane.places))  # positions of all ranks

        def coordinates(z: Vector) -> Vector:
            return plane.chart.place(wall.to_reference(waves.wall.to_physical(reference, z), z))

        z: Vector = np.zeros(len(reference))
        points = Points(plane, coordinates(z))
        for _ in range(TRIALS if wall.leans or waves.wall.leans else 1):  # positions depend on the elevation
            points.move(coordinates(z))
            z = points.evaluate(fields[0])
        begin = sum(comm.allgather(waves.plane.owned)[: comm.rank])
        mine = slice(begin, begin + waves.plane.owned)
        return z[mine], points.evaluate(fields[1])[mine]


MEAN_TOLERANCE = 0.01  # mean elevation above which a message is printed, relative to the rms
TOLERANCE = 1e-3  # largest difference of wall positions, relative to the depth
MESHED = {"cells", "geometry", "sponge_length", "factor", "refine", "file"}  # mesh of a layout


def initial_surface(case: Case, waves: AnyWaves) -> tuple[Vector, Vector]:
    """Return eta [m] and psi [m²/s] at the degrees of freedom, shape (owned,); collective.

    Raises ``InputError`` for a file, formula or run that cannot be used.
    """
    comm, initial = waves.plane.comm, case.initial
    if isinstance(initial, RunState):
        return stored_surface(case, initial, waves).on(waves)
    x, y = waves.plane.places.T
    return raise_on_all_ranks(comm, lambda: initial.surface(case.tank, x, y))


def stored_surface(case: Case, initial: RunState, waves: AnyWaves) -> StoredSurface:
    """Return the surface of a checkpoint, with values on the first rank only; collective. Raises ``InputError``."""
    comm = waves.plane.comm
    result: list[Checkpoint] = []

    def read() -> tuple[dict[str, Any], Case, StateTree]:
        path, about = _chosen(initial)
        before = _its_case(initial, about)
        try:
            checkpoint = read_checkpoint_file(path)
            tree = checked_tree(checkpoint.about, checkpoint.tree_json, [np.zeros(0)] * len(checkpoint.arrays))
        except UNREADABLE as error:
            raise InputError(f"{path}: cannot be used ({error}).") from None
        parts = tree["run"]["parts"]
        _check(case, before, about["t"], parts)
        result.append(checkpoint)
        return about, before, parts

    about, before, parts = from_first(comm, read)
    return StoredSurface.of(before, about, parts, result[0] if result else None)


def with_its_numerics(case: Case, initial: RunState) -> Case:
    """Return the case with the numerics of a run, except its own keys; raises ``InputError`` if they do not fit."""
    before = _its_case(initial, _chosen(initial)[1])
    numerics = case.numerics.over(before.numerics, named=case.numerics.model_fields_set)
    result = case.model_copy(update={"numerics": numerics})
    if problems := [*numerics.problems(result.ends[0], "numerics")]:
        raise CaseError(problems)
    return result


def start_message(case: Case, waves: AnyWaves, q: Vector) -> str:
    """Return the change of mass by a start from a run, or the mean of a given surface; otherwise empty; collective."""
    initial = case.initial
    if isinstance(initial, FileSurface | FormulaSurface):
        return _mean_message(waves, q)
    if not isinstance(initial, RunState):
        return ""
    about = from_first(waves.plane.comm, lambda: _chosen(initial)[1])
    mass = waves.total_mass(q) / about["mass"] - 1.0
    return f"initial surface: {initial.directory} at t = {about['t']:.6g} s; relative change of mass {mass:.1g}"


def _mean_message(waves: AnyWaves, q: Vector) -> str:
    """Return a sentence on the mean elevation of an initial surface, unless it is still water; collective."""
    still, higher = (waves.total_mass(waves.state(np.full_like(q, eta), 0 * q)[0]) for eta in (0.0, waves.depth))
    mean = (waves.total_mass(q) - still) / (higher - still) * waves.depth
    if abs(mean) < MEAN_TOLERANCE * waves.plane.rms(waves.elevation(q, 0 * q, 0.0)):
        return ""
    return f"the initial surface has a mean of {mean:+.3g} m: this is the level of the water at rest, not z = 0"


def _chosen(initial: RunState) -> tuple[Path, dict[str, Any]]:
    """Return the file of the requested checkpoint and its description; raises ``InputError``."""
    directory = RunDirectory(initial.directory)
    result = list(readable_checkpoints(directory.path))
    if not result:
        raise InputError(f"directory = {initial.directory}: must contain a checkpoint.")
    if initial.t is None:
        return result[0]
    at = initial.t
    for path, description in result:
        if is_at(description, at):
            return path, description
    times = " and ".join(f"{about['t']:.6g} s" for _, about in result)
    raise InputError(f"t = {at:g}: must be the time of a checkpoint: {times}.")


def _its_case(initial: RunState, about: dict[str, Any]) -> Case:
    try:
        return Case.model_validate(about["chosen"])
    except (KeyError, ValidationError):
        raise InputError(f"directory = {initial.directory}: must be a run of this version of the program.") from None


def _check(case: Case, before: Case, t: float, parts: StateTree) -> None:
    """Raise ``InputError`` if the tanks differ, or the positions of the walls."""
    for path, its, mine in differences(before.tank.model_dump(mode="json"), case.tank.model_dump(mode="json")):
        if path[0] != "layout" or path[-1] not in MESHED:
            key = ".".join(path)
            raise InputError(f"tank.{key} = {mine!r}: must be {its!r}, as in the run that provides the surface.")
    previous, present = _motions(before, parts), _motions(case)
    for name, was, now in zip(("wall", "far wall"), before.ends, case.ends, strict=True):
        places = [y for y in (one.wall.places(one.tank) for one in (was, now)) if y is not None]
        along = np.unique(np.concatenate(places)) if places else None
        at_end, at_start = _position(previous.get(was.key), t, along), _position(present.get(now.key), 0.0, along)
        difference = at_start - at_end
        if np.abs(difference).max() > TOLERANCE * case.tank.depth:
            most = int(np.abs(difference).argmax())
            there, here = (np.broadcast_to(one, difference.shape).flat[most] + 0.0 for one in (at_end, at_start))
            where = f"the {name} was at {there:.4g} m at t = {t:.6g} s, and begins at {here:.4g} m"
            raise InputError(
                f"{where}: the difference must be at most {TOLERANCE:g} of the depth, as with a wall at rest."
            )


def differences(before: Any, now: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Yield the path and both values of each key in which two cases differ."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*before, *now]):
            yield from differences(before.get(key), now.get(key), (*path, key))
    elif before != now:
        yield path, before, now


def _motions(case: Case, parts: StateTree | None = None) -> dict[str, Motion]:
    """Return the motions of the walls by their keys, with feedback as in ``parts``; empty for linear water."""
    if case.physics == "linear":
        return {}
    motions = [motion_of(end) for end in case.paddles]
    if parts is not None:
        restore_paddles(case, motions, parts)
    return {end.key: motion for end, motion in zip(case.paddles, motions, strict=True)}


def _position(motion: Motion | None, t: float, y: Vector | None) -> Vector:
    """Return the position of a motion [m] at positions y along the wall, or of a uniform wall; 0 for None."""
    return np.zeros(1) if motion is None else np.atleast_1d(motion.position(t, y)).ravel()
