"""Paddles with feedback of a case: active absorption, and springs with dampers."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from wavetank.base.mpi import from_first, raise_on_all_ranks
from wavetank.base.state import StateTree, typed
from wavetank.case import Case
from wavetank.case.wall import SpringDamper
from wavetank.motion.feedback import FeedbackState, StateSpaceFilter, elevation_at_face
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.supply import PaddleWork
from wavetank.tank.absorption import FaceElevation, Measurement, PaddleController, PaddleSlopes


def build_controllers(case: Case, waves: AnyWaves) -> list[PaddleController]:
    """Return the controllers of the absorbing paddles of a case; collective."""
    result = list[PaddleController]()
    for number in case.absorbing:
        end = case.paddles[number]
        wall: Any = end.wall
        paddle: Any = waves.wall.paddles[number]
        equation, measure = build_filter(case, number, waves)
        mode_shape = wall.mode_shape(end.tank)
        result.append(PaddleController(paddle, equation, measure, mode_shape=mode_shape, key=end.key))
    return result


def build_paddle_work(case: Case, waves: AnyWaves) -> PaddleWork | None:
    """Return the work of a case's paddles; None without active absorption."""
    if not case.absorbing:
        return None
    masses = np.array([end.wall.added_mass(case.tank) for end in case.paddles])
    return PaddleWork([paddle.motion for paddle in waves.wall.paddles], masses)


def restore_paddles(case: Case, motions: Iterable[Any], parts: StateTree) -> None:
    """Restore the feedback motions, among those of all paddles, from the parts of a run."""
    paddles = [*motions]
    for n, number in enumerate(case.absorbing):
        state = typed(FeedbackState, parts[f"paddle {n}"]["motion"], f"paddle {n}.motion")
        paddles[number].state = replace(state, retained={})


def build_filter(case: Case, number: int, waves: AnyWaves) -> tuple[StateSpaceFilter, Measurement]:
    """Return the filter of a paddle with feedback, given its number, and its measurement of the water; collective."""
    end, tank, comm = case.paddles[number], case.tank, waves.plane.comm
    wall: Any = end.wall
    paddle: Any = waves.wall.paddles[number]
    if isinstance(wall.absorb, SpringDamper):
        mass, stiffness, damping = wall.absorb.resolved(end)
        added = wall.added_mass(tank)
        slopes = PaddleSlopes(waves, number, paddle, mass=added)
        return StateSpaceFilter.of_spring(mass + added, stiffness, damping), slopes
    result = from_first(comm, lambda: wall.absorb.build(end))
    above, below = result.over_s()
    target = raise_on_all_ranks(
        comm,
        lambda: elevation_at_face(
            end.motion(), wall.wavemaker, depth=tank.depth, gravity=tank.gravity, duration=case.run.duration
        ),
    )
    elevation = FaceElevation(waves, paddle, target)
    return StateSpaceFilter.of_transfer(-above, below).with_feedthrough(elevation.rise), elevation
