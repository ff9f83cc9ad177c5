"""From the paddles of a scene that absorb to what answers the water: a row in a table for each noun."""

from collections.abc import Callable
from typing import Any

from wavetank.case import Scene
from wavetank.case.absorption import ActiveAbsorption
from wavetank.fe.agreed import agreed, from_first
from wavetank.motions.answer import Equation
from wavetank.motions.at_face import elevation_at_face
from wavetank.runs.waters import AnyWaves
from wavetank.values.noun import Noun
from wavetank.water.answering import Answered, AnsweringPaddle, Excess


def build_answers(scene: Scene, waves: AnyWaves) -> list[AnsweringPaddle]:
    """Return what answers the water, of each paddle of a scene that absorbs; collective."""
    found = list[AnsweringPaddle]()
    for seen, paddle in zip(scene.paddles, waves.wall.paddles, strict=True):
        absorb = getattr(seen.wall, "absorb", None)
        if absorb is not None:
            found.append(ANSWERS[type(absorb)](seen, absorb, paddle, waves))
    return found


def _active(scene: Scene, absorb: ActiveAbsorption, paddle: Answered, waves: AnyWaves) -> AnsweringPaddle:
    tank, comm = scene.tank, waves.plane.comm
    found = from_first(comm, lambda: absorb.build(tank, scene.wall.maker, paddle=scene.paddle_period))
    above, below = found.over_s()
    made = agreed(
        comm,
        lambda: elevation_at_face(
            scene.motion(), scene.wall.maker, depth=tank.depth, gravity=tank.gravity, duration=scene.run.duration
        ),
    )
    excess = Excess(waves, paddle, made)
    return AnsweringPaddle(paddle, Equation.of_transfer(-above, below).met_by(excess.rise), excess)


ANSWERS: dict[type[Noun], Callable[[Scene, Any, Any, AnyWaves], AnsweringPaddle]] = {ActiveAbsorption: _active}
