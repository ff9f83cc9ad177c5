"""From the paddles of a scene that absorb to what answers the water: a row in a table for each noun."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from wavetank.case import Scene
from wavetank.case.wall import ActiveAbsorption, SpringDamper
from wavetank.fem.agreed import agreed, from_first
from wavetank.motion.feedback import Equation, elevation_at_face
from wavetank.simulation.supply import AnsweredWork
from wavetank.simulation.waters import AnyWaves
from wavetank.stateful import Held
from wavetank.tank.answering import AnsweringPaddle, Excess, Look, Push
from wavetank.values.noun import Noun

Answered = tuple[Equation, Look]


def build_answers(scene: Scene, waves: AnyWaves) -> list[AnsweringPaddle]:
    """Return what answers the water, of each paddle of a scene that absorbs; collective."""
    found = list[AnsweringPaddle]()
    for number in scene.absorbing:
        seen = scene.paddles[number]
        wall: Any = seen.wall
        paddle: Any = waves.wall.paddles[number]
        equation, look = ANSWERS[type(wall.absorb)](scene, number, waves)
        shares = wall.mode_shape(seen.tank)
        found.append(AnsweringPaddle(paddle, equation, look, shares=shares, key=seen.key))
    return found


def added_motions(scene: Scene, waves: AnyWaves) -> dict[int, Any]:
    """Return how those paddles move that absorb, by their numbers: ``FeedbackMotion`` motions."""
    return {number: waves.wall.paddles[number].motion for number in scene.absorbing}


def build_supply(scene: Scene, waves: AnyWaves) -> AnsweredWork | None:
    """Return what counts the work of a scene's paddles, where some of them absorb."""
    if not scene.absorbing:
        return None
    walls: list[Any] = [seen.wall for seen in scene.paddles]
    masses = np.array([wall.added_mass(scene.tank) for wall in walls])
    return AnsweredWork([paddle.motion for paddle in waves.wall.paddles], masses)


def went_on(scene: Scene, motions: Iterable[Any], scheme: Held) -> None:
    """Let motions of a scene's paddles, those that absorb among them, stand where a run's scheme has held them."""
    paddles = [*motions]
    for n, number in enumerate(scene.absorbing):
        paddles[number].carry(scheme[f"paddle {n}"]["motion"])


def _active(scene: Scene, number: int, waves: AnyWaves) -> Answered:
    seen, tank, comm = scene.paddles[number], scene.tank, waves.plane.comm
    wall: Any = seen.wall
    paddle: Any = waves.wall.paddles[number]
    found = from_first(comm, lambda: wall.absorb.build(tank, wall.maker, paddles=scene.paddle_periods))
    above, below = found.over_s()
    made = agreed(
        comm,
        lambda: elevation_at_face(
            seen.motion(), wall.maker, depth=tank.depth, gravity=tank.gravity, duration=scene.run.duration
        ),
    )
    excess = Excess(waves, paddle, made)
    return Equation.of_transfer(-above, below).met_by(excess.rise), excess


def _on_spring(scene: Scene, number: int, waves: AnyWaves) -> Answered:
    wall: Any = scene.paddles[number].wall
    paddle: Any = waves.wall.paddles[number]
    mass, stiffness, damping = wall.absorb.resolved(scene.tank, wall.maker, paddles=scene.paddle_periods)
    added = wall.added_mass(scene.tank)
    equation = Equation.of_spring(mass + added, stiffness, damping)
    return equation, Push(waves, number, paddle, mass=added)


ANSWERS: dict[type[Noun], Callable[[Scene, int, AnyWaves], Answered]] = {
    ActiveAbsorption: _active,
    SpringDamper: _on_spring,
}
