"""What is known of a run's accuracy before it: what the mesh and the step hold, and what the plan predicts."""

from collections.abc import Iterator

import numpy as np

from wavetank.build import Waves
from wavetank.clock import ROUNDING, Clock
from wavetank.errors import InputError
from wavetank.fe.held import misfit, rms
from wavetank.hamiltonian.contract import Vector
from wavetank.plan.defaults import DEFAULT
from wavetank.plan.dispersion import relative_frequency_error
from wavetank.plan.plan import own_plan
from wavetank.plan.requirements import requirements
from wavetank.scene import Scene
from wavetank.scene.initial import StillWater
from wavetank.scene.numerics import HIGHEST_VERTICAL_ORDER

LARGE = 0.1  # predicted relative error of the elevation
HELD = 0.01  # what mesh and step may miss
MOST_STEPS = 500  # that are looked at
WITHIN = np.array([0.25, 0.5, 0.75])  # of a step: where


def forewarnings(scene: Scene, clock: Clock, waves: Waves) -> list[str]:
    """Return what is doubtful of a run before it begins, a sentence each, the same on all ranks; collective."""
    return [*_predicted(scene), *_bed(scene, waves), *_start(scene, waves), *_motion(scene, clock), *_end(scene, clock)]


def _predicted(scene: Scene) -> Iterator[str]:
    try:
        required, error = requirements(scene, DEFAULT), own_plan(scene, DEFAULT).error
    except InputError:
        return  # nothing can be predicted of it
    if error <= LARGE:
        return
    size = f"{error:.0%}" if error < 1.0 else "all of it"
    yield f"these numerics are predicted to miss the elevation by {size}; {_cure(required.k * required.depth)}"


def _cure(kd: float) -> str:
    if relative_frequency_error(kd, HIGHEST_VERTICAL_ORDER) < HELD:
        return "`wavetank plan` proposes others"
    return f"waves as short against the depth (k d = {kd:.3g}) are the same in a tank that is less deep"


def _bed(scene: Scene, waves: Waves) -> Iterator[str]:
    if scene.tank.bed is None:
        return
    missed, depth = misfit(waves.plane, scene.tank.bed.build())
    off = rms(waves.plane, np.asarray(missed / depth))
    if off > HELD:
        yield f"the mesh misses the bed by {off:.2g} of the depth: {_cells(waves)}"


def _start(scene: Scene, waves: Waves) -> Iterator[str]:
    if isinstance(scene.initial, StillWater):
        return
    for which, what in enumerate(("elevation", "surface potential")):

        def part(x: Vector, y: Vector, which: int = which) -> Vector:
            return scene.initial.surface(scene.tank, x, y)[which]

        missed, whole = misfit(waves.plane, part)
        if rms(waves.plane, missed) > HELD * (size := rms(waves.plane, whole)):
            share = rms(waves.plane, missed) / size
            yield f"the mesh misses the initial {what} by {share:.2g} of it: {_cells(waves)}"


def _cells(waves: Waves) -> str:
    return f"cells of {waves.plane.cell_size:.3g} m are too large for it"


def _motion(scene: Scene, clock: Clock) -> Iterator[str]:
    """Yield a sentence if cubics through positions and velocities at the steps are not the motion between them."""
    steps = np.unique(np.linspace(0, clock.steps - 1, min(clock.steps, MOST_STEPS)).astype(int))
    begin, s = clock.dt * steps, WITHIN[:, None]
    begin_s, end_s = (2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s), (3 * s**2 - 2 * s**3, s**3 - s**2)
    motion = scene.motion()
    position, velocity = scene.of_paddle(motion, "position"), scene.of_paddle(motion, "velocity")

    def flat(values: Vector) -> Vector:
        return values.reshape(1, begin.size, -1)

    cubic = sum(
        weights[0][..., None] * flat(position(t)) + clock.dt * weights[1][..., None] * flat(velocity(t))
        for weights, t in ((begin_s, begin), (end_s, begin + clock.dt))
    )
    exact = position((begin + clock.dt * s).ravel()).reshape(WITHIN.size, begin.size, -1)
    stroke = float(np.sqrt(np.mean((exact - exact.mean(axis=(0, 1))) ** 2)))
    missed = float(np.sqrt(np.mean((cubic - exact) ** 2)))
    if missed > HELD * stroke:
        yield f"the step of {clock.dt:.3g} s misses the paddle's motion by {missed / stroke:.2g} of it: it is too long"


def _end(scene: Scene, clock: Clock) -> Iterator[str]:
    """Yield a sentence if the last step is left out, as the recorded motion does not cover it."""
    if clock.end < scene.run.duration * (1 - ROUNDING):
        beyond = f"one more step of {clock.dt:.3g} s would end beyond the recorded motion"
        yield f"the run ends at {clock.end:.6g} s, not at {scene.run.duration:.6g} s: {beyond}"
