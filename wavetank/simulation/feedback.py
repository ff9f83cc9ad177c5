"""Paddles with feedback of a case: active absorption, and springs with dampers."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from wavetank.case import (
    Case,
)
from wavetank.case.wall import ActiveAbsorption, SpringDamper
from wavetank.motion.feedback import FeedbackState, StateSpaceFilter, elevation_at_face
from wavetank.mpi import from_first, raise_on_all_ranks
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.supply import PaddleWork
from wavetank.state import StateTree, typed
from wavetank.tank.answering import Excess, Measurement, PaddleController, Push
from wavetank.values.case_model import CaseModel, entry

Answered = tuple[StateSpaceFilter, Measurement]


def build_controllers(scene: Case, waves: AnyWaves) -> list[PaddleController]:
    """Return the controllers of the paddles of a scene that absorb; collective."""
    result = list[PaddleController]()
    for number in scene.absorbing:
        end = scene.paddles[number]
        wall: Any = end.wall
        paddle: Any = waves.wall.paddles[number]
        equation, measure = entry(CONTROLLERS, wall.absorb, f"CONTROLLERS of {__file__}")(scene, number, waves)
        mode_shape = wall.mode_shape(end.tank)
        result.append(PaddleController(paddle, equation, measure, mode_shape=mode_shape, key=end.key))
    return result


def build_paddle_work(scene: Case, waves: AnyWaves) -> PaddleWork | None:
    """Return what counts the work of a scene's paddles, where some of them absorb."""
    if not scene.absorbing:
        return None
    walls: list[Any] = [end.wall for end in scene.paddles]
    masses = np.array([wall.added_mass(scene.tank) for wall in walls])
    return PaddleWork([paddle.motion for paddle in waves.wall.paddles], masses)


def restore_paddles(scene: Case, motions: Iterable[Any], parts: StateTree) -> None:
    """Move paddles with feedback to where the parts of a run have them, among the motions of all paddles."""
    paddles = [*motions]
    for n, number in enumerate(scene.absorbing):
        state = typed(FeedbackState, parts[f"paddle {n}"]["motion"], f"paddle {n}.motion")
        paddles[number].state = replace(state, retained={})


def _active(scene: Case, number: int, waves: AnyWaves) -> Answered:
    end, tank, comm = scene.paddles[number], scene.tank, waves.plane.comm
    wall: Any = end.wall
    paddle: Any = waves.wall.paddles[number]
    result = from_first(comm, lambda: wall.absorb.build(tank, wall.wavemaker, paddles=scene.paddle_periods))
    above, below = result.over_s()
    made = raise_on_all_ranks(
        comm,
        lambda: elevation_at_face(
            end.motion(), wall.wavemaker, depth=tank.depth, gravity=tank.gravity, duration=scene.run.duration
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


CONTROLLERS: dict[type[CaseModel], Callable[[Case, int, AnyWaves], Answered]] = {
    ActiveAbsorption: _active,
    SpringDamper: _on_spring,
}
