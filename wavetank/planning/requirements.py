"""Requirements of a case: its waves, how long they travel, their steepness, run-up and absorption.

**The waves of a paddle** are those of linear wavemaker theory: a_j = c(k_j) |X_j|, with X_j the Fourier coefficients of
its motion over the run (of a short run, and beyond it: ``WINDOW``) and c the paddle's transfer function
(``waves/wavemaker.py``). Each component is followed from the paddle to the farthest gauge that its group reaches within
the run, with all later passages after reflections at both ends (``travel.py``); if there is no gauge, or most of the
energy has not arrived, to the far wall. The energy that a gauge records weights its error. A standing wave is followed
for the complete run.

**Steepness** counts in Stokes' expansion at k of the highest crest of the waves of one direction, s = k a,
sigma = tanh(k d):

    a_2 / a_1 = s (3 - sigma²) / (4 sigma³),     a_3 / a_1 = s² (27 - 9 sigma² + 9 sigma⁴ - 3 sigma⁶) / (64 sigma⁶),
    omega / omega_linear - 1 = s² (9 - 10 sigma² + 9 sigma⁴) / (16 sigma⁴).

Waves of permanent form are exact: their harmonics, speed and velocity are those of the wave itself. A solitary wave is
one whose period is a window around its crest. Standing waves have the crest, harmonics and frequency of their own
expansion (``standing_harmonics``). They start without bound harmonics, and the free ones that compensate for these
at the start beat: with k a = 0.3, k d = pi / 2 the crest reaches 1.45 a, that of a travelling wave 1.15 a.

**The run-up of a solitary wave** at a vertical wall has a peak narrower than the wave. With R the run-up, d the depth
and h = H / d the relative wave height, its curvature at the wall is -R / l², and

    l / d = (2 / (3 h))^(1/2) (1 - (3 h / 2)²),     R / d = 2 h + h² / 2 + 3 h³ / 4.

The first factor of l is the sech² profile's. The second is fitted to converged runs of h = 0.05 to 0.6 (within 2 %, at
0.6 6 %); it vanishes at h = 2/3, where the run-up ends in a thin jet. The relative error of R is predicted as

    e = 0.1 (dx / ((p - 1) l))⁴ + |e_n(k d = (d + R) / l)|,

e_n being the relative error of the linear frequency by the vertical order alone. The first term is fitted to p = 2 to 5
with e = 0.1 to 5 %: it is 0.7 to 2 times the measured error for h = 0.5 and 0.6, and 2 to 6 times for lower waves. The
second is 0.9 to 2 times the measured error if that is above 0.1 % (docs/plan.md). The step needs no term: a stable step
misses less than 0.1 %.

**Paddles that absorb waves by their elevation** extrapolate it within a step. That changes the reflection by
C c^(-3/2) (omega dt)^(7/2), with c the transfer function of the paddle and C from runs of regular waves between a
paddle and one that absorbs (``ABSORPTION``).

Sources: G. B. Whitham, Linear and Nonlinear Waves, 1974, section 13.13; R. G. Dean and R. A. Dalrymple 1991, chapter
11; I. Tadjbakhsh and J. B. Keller, J. Fluid Mech. 8, 1960 (standing waves); R by C. H. Su and R. M. Mirie, "On head-on
collisions between two solitary waves", J. Fluid Mech. 98, 1980.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank import case as nouns
from wavetank.arrays import Vector
from wavetank.case import Case, EndWall, Physics
from wavetank.case.tank import AnyTank
from wavetank.errors import InputError
from wavetank.motion import Motion
from wavetank.planning import travel
from wavetank.planning.dispersion import Mesh, relative_frequency_error
from wavetank.values.case_model import CaseError, Problem
from wavetank.waves import airy
from wavetank.waves.conformal import SteadyWave
from wavetank.waves.second_order import Strokes, second_order
from wavetank.waves.solitary_wave import solitary_wave

RESOLVED = 0.6  # H / d of the highest run-up that was computed with two meshes within 0.02 %
CELLS = 0.1  # factor of the cells' part
LINEAR = 0.3  # in the place of p - 1 for order 1


@dataclass(frozen=True)
class RunUp:
    """The run-up of a solitary wave.

    Attributes
    ----------
    height
        Wave height over depth, H / d.
    depth
        Still-water depth d [m].
    """

    height: float
    depth: float

    @property
    def resolved(self) -> bool:
        """Whether its accuracy can be predicted."""
        return self.height <= RESOLVED

    @property
    def width(self) -> float:
        """The length l of the peak [m], that of ``RESOLVED`` for higher waves."""
        h = min(self.height, RESOLVED)
        return self.depth * float(np.sqrt(2 / (3 * h))) * (1 - (1.5 * h) ** 2)

    @property
    def elevation(self) -> float:
        """The run-up R [m]."""
        h = min(self.height, RESOLVED)
        return self.depth * (2 * h + h**2 / 2 + 0.75 * h**3)

    def error(self, mesh: Mesh) -> float:
        """Return the predicted relative error of R on a mesh."""
        nodes = mesh.cells.size / max(mesh.cells.order - 1, LINEAR)
        kd = (self.depth + self.elevation) / self.width
        return CELLS * (nodes / self.width) ** 4 + abs(relative_frequency_error(kd, mesh.vertical_order))


ABSORPTION = 2.5  # measured 1.6 to 3.5: pistons at k d = 0.7, 1.5, 2.5, flaps at 0.7, 1.5, 28 and 40 steps a period
ABSORPTION_POWER = 3.5  # measured 3.2 to 3.9


def absorption_error(scene: Case, k: Vector) -> Vector:
    """Return the error of waves of wave numbers k [rad/m] over (omega dt)^(7/2), shape (N,).

    It counts from the time at which waves have returned to the farthest gauge. Of several paddles the largest counts.
    """
    if not scene.absorbing:
        return np.zeros_like(k)
    depth, length = scene.tank.depth, scene.tank.length
    path = 2 * length - max((gauge.x for gauge in scene.all_gauges), default=length)
    back = path / airy.group_velocity(k, depth, scene.tank.gravity)
    least = np.min([scene.paddles[n].wall.wavemaker.transfer(k, depth) for n in scene.absorbing], axis=0)
    return np.asarray(ABSORPTION * least**-1.5 * np.sqrt(np.maximum(0.0, 1.0 - back / scene.run.duration)))


REMAINING = 0.05  # of the free second harmonic after second-order generation, in steep waves
MOST_COMPONENTS = 40
MOST_TIMES = 2**16  # at which a motion is sampled: an hour of it in a tank 0.5 m deep
DEEPEST = 40.0  # k d of the highest frequency of a motion
TAPER = 0.25  # fraction of a motion that is tapered at its end, or its spectrum is that of a jump
TRIED = 4001  # times beyond a short run's end
WINDOW = 36.0  # (d / g)^(1/2): least analysed duration of a motion; part of a period has the spectrum of short waves
NOISE = 1 / 30  # of a measured motion's strongest lines: what is shorter and weaker is the instrument's
POINTS = 1024  # along a wave of permanent form
TAIL, FARTHEST = 1e-3, 60.0  # of a solitary wave: where it ends, relative to its height, and depths searched
BEYOND = 4  # harmonics of a standing wave beyond those of its expansion
DECAY = 1.85  # r_(m+1) / r_m of these over r_3 / r_2; 1.83 to 1.95 in runs of k a = 0.15 to 0.3 (docs/plan.md)
NEGLIGIBLE = 1e-5  # of its first harmonic
RETURNING = 0.1  # of the recorded energy: where less is reflected, the crest is that of waves that travel away
REACHED = 0.9  # of the energy: of a run that ends before it gets to a gauge all that is in the tank counts
PLACES = 33  # at which the highest crest is searched
AROUND = 4  # groups of lines on either side: of fewer the envelope has no place in time
TIMES = 512  # at which an envelope is sampled


class WaveComponents(NamedTuple):
    """The waves of a scene, shape (N,) each.

    Attributes
    ----------
    k, omega
        Wave numbers [rad/m] and angular frequencies [rad/s].
    amplitude
        Amplitudes of the elevation [m].
    age
        For how long each is followed [s].
    """

    k: Vector
    omega: Vector
    amplitude: Vector
    age: Vector

    def selected(self, which: NDArray[np.bool_]) -> "WaveComponents":
        """Return some of them, shape (N,)."""
        return WaveComponents(*(part[which] for part in self))


class CaseWaves(NamedTuple):
    """Components, the highest crest of their sum by linear theory [m], and the exact wave if they are one.

    ``steep_time`` is the time for which they are about as high [s]; ``run_up`` is that of a solitary wave at a wall,
    ``free`` are the free second harmonics of a paddle, ``progressive`` is the crest of the waves of one direction [m].
    """

    components: WaveComponents
    crest: float
    form: "Form | None" = None
    steep_time: float = np.inf
    run_up: RunUp | None = None
    free: WaveComponents = WaveComponents(*4 * [np.empty(0)])
    progressive: float = 0.0


class Form(NamedTuple):
    """A wave of permanent form, or a standing one.

    Attributes
    ----------
    harmonics
        Amplitudes of its harmonics relative to the first, shape (M,).
    velocity
        The largest of the water at the surface [m/s].
    excess
        Its frequency over that of linear theory, less 1.
    crest
        The highest it gets [m].
    """

    harmonics: Vector
    velocity: float
    excess: float
    crest: float


class StokesHarmonics(NamedTuple):
    """Stokes' bound harmonics: amplitudes relative to the first, and the relative change of frequency."""

    second: float
    third: float
    frequency: float

    @property
    def ratios(self) -> Vector:
        """The first four relative to the first, at most 1 (a_4 = a_3² / a_2), shape (4,)."""
        return np.minimum([1.0, self.second, self.third, self.third**2 / self.second], 1.0)


def stokes(steepness: float, kd: float) -> StokesHarmonics:
    """Return Stokes' harmonics of a wave of steepness k a in depth k d; see the module's formulae."""
    s, sigma = steepness, np.tanh(kd)
    return StokesHarmonics(
        float(s * (3 - sigma**2) / (4 * sigma**3)),
        float(s**2 * (27 - 9 * sigma**2 + 9 * sigma**4 - 3 * sigma**6) / (64 * sigma**6)),
        float(s**2 * (9 - 10 * sigma**2 + 9 * sigma**4) / (16 * sigma**4)),
    )


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """What a scene requires, for an accuracy.

    Attributes
    ----------
    accuracy
        Largest relative error of the elevation.
    tank, duration
        The tank, and the duration of the run [s].
    waves
        The components.
    k
        Wave number of the mean energy [rad/m].
    steepness, highest
        k a of the highest crest, by linear theory or of a wave of permanent form; and of what a standing wave gets to.
    velocity
        The horizontal velocity in the crest, a omega / tanh(k d) [m/s].
    harmonics
        Amplitudes of bound harmonics relative to the first, shape (M,): one where linear waves do.
    run_up
        The highest run-up of a solitary wave at a wall; None where there is none.
    absorption_error
        Of each component: its error by paddles that absorb, over (omega dt)^(7/2), shape (N,).
    measured
        Motions of paddles that were measured: steps must hold them, noise and all.
    physics
        "linear" or "nonlinear".
    reasons
        Which objects are needed and why, a sentence each.
    """

    accuracy: float
    tank: AnyTank
    duration: float
    waves: WaveComponents
    k: float
    steepness: float
    highest: float
    steep_time: float
    velocity: float
    harmonics: Vector
    run_up: RunUp | None
    absorption_error: Vector
    measured: tuple[Motion, ...]
    physics: Physics
    reasons: tuple[str, ...]


def unplanned(scene: Case) -> str | None:
    """Return why no plan can be made of a scene's tank and start, or None where one can."""
    tank = scene.tank
    if isinstance(tank, nouns.BasinTank) or tank.bed is not None:
        what = f'tank.type = "{tank.type}"' if tank.bed is None else f'tank.bed.type = "{tank.bed.type}"'
        return f"{what}: plans are made for slices and rings with a flat bed"
    if type(scene.initial) not in STARTS:
        allowed = ", ".join(sorted(kind.model_fields["type"].default for kind in STARTS))
        return f'initial.type = "{scene.initial.type}": plans are made for {allowed}'
    return None


def requirements(scene: Case, accuracy: float) -> Requirements:
    """Return what a scene requires for a relative error of the elevation of ``accuracy``; its water stays if it is set.

    Raises ``InputError`` for a scene in which nothing moves, or whose tank or initial state is not planned for.
    """
    tank = scene.tank
    if why := unplanned(scene):
        allowed = f"must be left out, then cells and vertical order follow a rule: {why}"
        raise CaseError([Problem(("numerics", "accuracy"), scene.numerics.accuracy, allowed)])
    waves, crest, form, steep_time, run_up, free, progressive = _all_waves(scene, accuracy)
    motions = [end.motion() for end in scene.paddles]
    energy = waves.amplitude**2
    k = float(energy @ waves.k / energy.sum())
    harmonics = stokes(k * progressive, k * tank.depth)
    ratios, excess = (form.harmonics, form.excess) if form else (harmonics.ratios, harmonics.frequency)
    phase = float(excess * (energy @ (waves.omega * waves.age)) / energy.sum())
    second = float(ratios[1])
    physics = _enough(accuracy, second, phase) if _is_free(scene) else scene.physics
    waves = _joined([waves, free]) if physics == "nonlinear" else waves
    reasons = [
        f"footprint: a {tank.type}, the scene has one horizontal dimension.",
        f"bed: flat, the depth is {tank.depth:g} m everywhere; k d = {k * tank.depth:.3g}.",
        _physics_reason(scene, accuracy, k * crest, second, phase),
        _wall_reason(scene),
        _end_reason(scene, waves),
    ]
    if run_up is not None:
        peak = f"about {run_up.elevation:.3g} m with a peak of length {run_up.width:.3g} m"
        reasons.append(
            f"run-up: the solitary wave meets a wall; {peak} decides on cells and vertical order beside the wave."
        )
    return Requirements(
        accuracy=accuracy,
        tank=tank,
        duration=scene.run.duration,
        waves=waves,
        k=k,
        steepness=k * crest,
        highest=k * (form.crest if form else crest),
        steep_time=steep_time,
        velocity=form.velocity if form else _crest_velocity(k, crest, scene),
        harmonics=ratios if physics == "nonlinear" else np.ones(1),
        run_up=run_up,
        absorption_error=absorption_error(scene, waves.k),
        measured=tuple(one for one in motions if one.interval is not None),
        physics=physics,
        reasons=tuple(reasons),
    )


def _crest_velocity(k: float, crest: float, scene: Case) -> float:
    tank = scene.tank
    return float(crest * airy.angular_frequency(k, tank.depth, tank.gravity) / np.tanh(k * tank.depth))


def _physics_reason(scene: Case, accuracy: float, steepness: float, second: float, phase: float) -> str:
    enough = _enough(accuracy, second, phase)
    choice = enough if _is_free(scene) else f"{scene.physics}, as the case says"
    return (
        f"water: {choice}; at k a = {steepness:.3g} linear theory misses a second harmonic of {second:.2g} of the "
        f"first and {abs(phase):.2g} rad of phase, {'at most' if enough == 'linear' else 'more than'} the accuracy of "
        f"{accuracy:g}."
    )


def _is_free(scene: Case) -> bool:
    """Return whether the water is the plan's to choose: linear water has no velocities to be recorded."""
    return scene.water is None and scene.output.velocity_every is None


def _enough(accuracy: float, second: float, phase: float) -> Physics:
    return "linear" if np.hypot(second, phase) <= accuracy else "nonlinear"


def _wall_reason(scene: Case) -> str:
    if isinstance(scene.tank, nouns.RingTank):
        return "wall at x = 0: none in a ring."
    if not scene.wall.moves:
        return "wall at x = 0: fixed, nothing moves there."
    return f"wall at x = 0: {_paddle_reason(scene.ends[0])}"


def _paddle_reason(end: EndWall) -> str:
    """Return a description of a paddle."""
    paddle, absorbs = f"a {end.wall.type}", absorption(end)
    close = f"; {absorbs}." if absorbs else "."
    if end.motion().interval is not None:
        return f"{paddle} with a measured motion; short waves below {NOISE:.1%} count as its noise{close}"
    if not end.motion().moves:
        return f"{paddle} that is not driven{close}"
    order, reason = end.generation
    by = f" by {order} generation" if order else ""
    return f"{paddle}, the waves come from its motion{by}{f', as {reason}' if reason else ''}{close}"


def absorption(end: EndWall) -> str:
    """Return a description of a paddle's absorption; empty if it does not absorb."""
    return "" if end.wall.absorb is None else str(end.wall.absorb.description(end))


def _end_reason(scene: Case, waves: WaveComponents) -> str:
    if isinstance(scene.tank, nouns.RingTank):
        return "far end: none, a ring needs no sponge."
    if scene.sponge is not None:
        return f"far end: a sponge (type {scene.sponge.type}) absorbs what comes; what it reflects is not planned for."
    if scene.far_wall.moves:
        return f"far end: {_paddle_reason(scene.ends[1])}"
    fastest = float(airy.group_velocity(waves.k, scene.tank.depth, scene.tank.gravity).max())
    if not scene.wall.moves or fastest * scene.run.duration > scene.tank.length:
        energy = waves.amplitude**2
        age = float(np.sqrt(energy @ waves.age**2 / energy.sum()))
        return f"far end: a wall that reflects; waves are followed over the run, for {age:.3g} s (root mean square)."
    return "far end: a wall, no sponge is needed, no wave gets there within the run."


# ---------------------------------------------------------------- the waves
def _all_waves(scene: Case, accuracy: float) -> CaseWaves:
    result = STARTS[type(scene.initial)](scene.initial, scene)
    for end in scene.paddles:
        if (motion := end.motion()).moves:
            result.append(_paddle_waves(end, motion, accuracy))
    if not result or not max(waves.crest for waves in result) > 0.0:
        raise InputError("the scene: nothing moves in it; a plan needs a wave or a paddle that moves.")
    form = next((waves.form for waves in result), None)
    crest, steep_time = sum(waves.crest for waves in result), max(waves.steep_time for waves in result)
    run_ups = [waves.run_up for waves in result if waves.run_up is not None]
    highest = max(run_ups, key=lambda one: one.height, default=None)
    components, free = (_joined(parts) for parts in zip(*((one.components, one.free) for one in result), strict=True))
    progressive = sum(waves.progressive for waves in result)
    return CaseWaves(components, crest, form, steep_time, highest, free, progressive)


def _joined(several: Iterable[WaveComponents]) -> WaveComponents:
    return WaveComponents(*(np.concatenate(part) for part in zip(*several, strict=True)))


def _standing_wave(wave: nouns.StandingWave, scene: Case) -> list[CaseWaves]:
    tank, a = scene.tank, wave.wave_amplitude
    k = wave.mode * np.pi / tank.length * np.arange(1, 3)  # of the second harmonic, that which is free
    in_space, excess = standing_harmonics(float(k[0]) * a, float(k[0]) * tank.depth)
    sizes = np.linalg.norm(in_space * [1.0, *3 * [np.sqrt(0.5)]], axis=1)  # for means over a period
    ratios = np.minimum(sizes / sizes[0], 1.0)
    beyond = np.minimum(DECAY * ratios[-1] / ratios[-2], 1.0) ** np.arange(1, BEYOND + 1)
    ratios = np.append(ratios, ratios[-1] * beyond)
    omega, age = airy.angular_frequency(k, tank.depth, tank.gravity), np.full(2, scene.run.duration)
    components = WaveComponents(np.asarray(k), omega, a * ratios[:2], age)
    form = Form(ratios, _crest_velocity(float(k[0]), a, scene), excess, a * (2 * float(in_space.sum()) - 1.0))
    return [CaseWaves(components, a, form)]


def standing_harmonics(steepness: float, kd: float) -> tuple[Vector, float]:
    """Return E_ij, shape (3, 4), and the relative change of the frequency of a standing wave of k a in depth k d.

    To third order it is eta = a sum E_ij cos(i k x) cos(j omega t), i from 1 and j from 0 on.
    """
    s, T = steepness, float(np.tanh(kd))
    E = np.zeros((3, 4))
    E[0, 1], E[0, 3] = 1.0, -(s**2) / 256 * (3 * T**-4 + 18 * T**-2 - 5)
    E[1, 0], E[1, 2] = s / 8 * (T + 1 / T), s / 8 * (3 * T**-3 - 1 / T)
    E[2, 1] = 3 * s**2 / 256 * (9 * T**-4 + 27 * T**-2 - 15 + T**2 + 2 * T**4)
    E[2, 3] = 3 * s**2 / 256 * (9 * T**-6 - 3 * T**-4 + 3 * T**-2 - 1)
    return E, s**2 / 64 * (9 * T**-4 - 12 * T**-2 - 3 - 2 * T**2)


def _followed(
    exact: SteadyWave, height: float, scene: Case, *, distance: float, begin: float = 0.0, wall: Any = None
) -> CaseWaves:
    """Return a solitary wave whose crest is at a distance [m] from a wall, the far one by default, at a time [s]."""
    x = scene.tank.depth * np.linspace(0.0, FARTHEST, POINTS)
    half = float(x[np.flatnonzero(exact.elevation(exact.crest + x) > TAIL * height)[-1]])
    waves = _steady_waves(exact, 2 * half, scene)
    arrives = begin + distance / exact.speed < scene.run.duration
    if scene.sponge is not None or getattr(wall or scene.far_wall, "absorb", None) is not None or not arrives:
        return waves
    return waves._replace(run_up=RunUp(height / scene.tank.depth, scene.tank.depth))


def _steady_waves(exact: SteadyWave, length: float, scene: Case) -> CaseWaves:
    """Return a wave of permanent form by its harmonics in a window of a length [m] around its crest."""
    tank, k = scene.tank, np.array([2 * np.pi / length])
    places = length / POINTS * np.arange(POINTS)
    eta, psi = exact.surface(exact.crest + np.where(places > length / 2, places - length, places))
    amplitudes = 2 / POINTS * np.abs(np.fft.rfft(eta))[1:]
    selected = 1 + int(np.flatnonzero(amplitudes > NEGLIGIBLE * amplitudes[0])[-1])
    velocity = float(psi[1] * POINTS / length)  # the surface is level at the crest, and psi is odd
    excess = exact.speed * float(k[0] / airy.angular_frequency(k, tank.depth, tank.gravity)[0]) - 1.0
    components = WaveComponents(k, exact.speed * k, amplitudes[:1], np.array([scene.run.duration]))
    form = Form(amplitudes[: max(selected, 2)] / amplitudes[0], velocity, excess, float(eta.max()))
    return CaseWaves(components, form.crest, form)


class _Lines(NamedTuple):
    """Spectral lines, shape (N,) each: omega [rad/s], k [rad/m], and the elevation at the paddle [m], complex."""

    omega: Vector
    k: Vector
    elevation: NDArray[np.complex128]

    @property
    def duration(self) -> float:
        """Of the motion that they are of [s]."""
        return 2 * np.pi / float(self.omega[0])

    def squared_envelope(self, group: NDArray[np.int_]) -> Vector:
        """Return the squared envelope [m²] of a group of lines that follow each other, at ``TIMES`` equal steps."""
        step = -(-group.size // TIMES)  # of more lines than times, by means over so many
        envelope = np.fft.ifft(self.elevation[group], TIMES * step, norm="forward")
        return np.asarray(np.mean(np.abs(envelope.reshape(TIMES, step)) ** 2, axis=1))


def _paddle_waves(end: EndWall, motion: Motion, accuracy: float) -> CaseWaves:
    if isinstance(solitary := getattr(end.wall, "motion", None), nouns.SolitaryWaveMotion):
        exact = solitary_wave(solitary.height, depth=end.tank.depth, gravity=end.tank.gravity)
        begin = solitary.crest_time_in(end.tank)
        return _followed(exact, solitary.height, end.case, distance=end.tank.length, begin=begin, wall=end.opposite)
    tank, lines = end.tank, _lines(end, motion)
    groups = _groups(lines, _highest(motion, lines, accuracy), 0.05 * accuracy**2)
    omega, amplitude = _gathered(lines, groups)
    k, energy = airy.wave_number(omega, tank.depth, tank.gravity), amplitude**2
    around = [groups[max(0, n - AROUND) : n + AROUND + 1] for n in range(len(groups))]
    squares = np.array([lines.squared_envelope(np.concatenate(some)) for some in around])
    free, squared = _free_harmonic(end, float(energy @ k / energy.sum()), lines)
    each = np.append(k, free.k), np.append(energy, 0.0), np.vstack([squares, squared**2])
    age, fraction, reflected = _travel(end, *each)
    returning = bool(reflected[:-1] @ energy > RETURNING * (fraction[:-1] @ energy))

    result = WaveComponents(k, omega, amplitude * np.sqrt(fraction[:-1]), age[:-1])
    freed = free._replace(amplitude=free.amplitude * np.sqrt(energy.sum() * fraction[-1:]), age=age[-1:])
    crest, mean_square = _crest(end, lines, returning)
    steep_time = 4 * lines.duration * mean_square / max(crest, 1e-300) ** 2
    free = freed.selected(fraction[-1:] > 0.0)
    progressive = max(crest / 2, _crest(end, lines, False)[0])  # at a wall that reflects both directions add up
    return CaseWaves(result.selected(fraction[:-1] > 0.0), crest, None, steep_time, None, free, progressive)


def _free_harmonic(end: EndWall, k: float, lines: _Lines) -> tuple[WaveComponents, Vector]:
    """Return the free waves of twice the frequency that a paddle makes, over the waves of wave number k [rad/m].

    Their amplitude is that of a regular wave as high (``waves/second_order.py``), at most that itself. They grow with
    the square of the envelope, which is returned, too.
    """
    depth, g, wavemaker = end.tank.depth, end.tank.gravity, end.wall.wavemaker
    squares = lines.squared_envelope(np.arange(lines.omega.size))
    size = float(np.sqrt(np.sum(squares**2) / max(np.sum(squares), 1e-300)))
    omega = 2 * airy.angular_frequency(np.array([k]), depth, g)
    free = airy.wave_number(omega, depth, g)
    stroke = Strokes(omega / 2, np.array([size / complex(wavemaker.transfer(k, depth))]))
    made_up = second_order(stroke, wavemaker, depth=depth, gravity=g).b[:1]
    ratio = np.minimum(1.0, np.abs(made_up) * wavemaker.transfer(free, depth) / max(size, 1e-300))
    remaining = REMAINING if end.generation[0] == "second-order" else 1.0
    return WaveComponents(free, omega, remaining * ratio, np.zeros(1)), squares


def highest_frequency(end: EndWall, accuracy: float) -> float:
    """Return the frequency [rad/s] above which a measured motion is noise; ``inf`` of any other."""
    motion = end.motion()
    return np.inf if motion.interval is None else _highest(motion, _lines(end, motion), accuracy)


def _highest(motion: Motion, lines: _Lines, accuracy: float) -> float:
    if motion.interval is None or not np.any(lines.elevation):
        return np.inf
    omega, amplitude = _gathered(lines, _groups(lines, np.inf, 0.05 * accuracy**2))
    return float(omega[amplitude > NOISE * amplitude.max()].max())


def _lines(end: EndWall, motion: Motion) -> _Lines:
    """Return the spectral lines of the paddle's waves, from 1 / duration to the k d of ``DEEPEST``.

    Of a motion of more than ``MOST_TIMES``, those of its first part.
    """
    tank = end.tank
    highest = np.sqrt(DEEPEST * tank.gravity / tank.depth) / (2 * np.pi)
    duration = min(analysed_duration(end, motion), float(MOST_TIMES / (4 * highest)))
    count = 2 * int(np.ceil(2 * highest * duration)) + 64
    t = np.asarray(duration / count * np.arange(count), dtype=np.float64)
    positions = motion.position(t)
    coefficients = np.fft.rfft(positions * tapered(np.asarray(t / duration)))[1:-1] * (2 / count)
    omega: Vector = 2 * np.pi / duration * np.arange(1, count // 2, dtype=np.float64)
    k = airy.wave_number(omega, tank.depth, tank.gravity)
    return _Lines(omega, k, 1j * end.wall.wavemaker.transfer(k, tank.depth) * coefficients)


def analysed_duration(end: EndWall, motion: Motion) -> float:
    """Return the duration of a motion whose spectrum is analysed [s]: longer than a short run, where it is defined.

    A user's motion need not be finite after the run: it is evaluated there first.
    """
    least = WINDOW * float(np.sqrt(end.tank.depth / end.tank.gravity))
    until = min(least, motion.duration)
    if until > end.duration:
        try:
            motion.rates(np.linspace(end.duration, until, TRIED, dtype=np.float64), end.wall.places(end.tank))
        except InputError:
            return end.duration
    return float(max(end.duration, until))


def tapered(part: Vector) -> Vector:
    """Return the taper at fractions of the analysed duration, shape (N,)."""
    return np.asarray(np.cos(np.pi / 2 * np.maximum(0.0, (part - 1.0) / TAPER + 1.0)) ** 4)


def _crest(end: EndWall, lines: _Lines, returning: bool) -> tuple[float, float]:
    """Return the largest elevation [m] between the paddle and the farthest gauge, and the mean square [m²] there.

    Where waves return to the gauges, that is along the tank, with all reflections.
    """
    tank, at = end.tank, travel.reflections(end, lines.omega)
    count = 2 * (lines.omega.size + 1)
    spectra = np.zeros((PLACES, count // 2 + 1), dtype=complex)
    farthest = max((float(end.distance(gauge.x)) for gauge in end.case.all_gauges), default=tank.length)
    places = np.linspace(0.0, tank.length if returning else farthest, PLACES, dtype=np.float64)
    speed = airy.group_velocity(lines.k, tank.depth, tank.gravity)
    passed = np.exp(-1j * np.outer(places, lines.k))
    if returning:
        passed = travel.response(places, lines.k, speed, length=tank.length, at=at, duration=end.duration)
    spectra[:, 1:-1] = lines.elevation * passed * (count / 2)
    elevation = np.fft.irfft(spectra, count)
    return float(np.abs(elevation).max()), float(np.mean(elevation**2))


def _groups(lines: _Lines, highest: float, lost: float) -> list[NDArray[np.int_]]:
    """Return the lines in few groups, up to a frequency [rad/s], without ends of a fraction ``lost`` of the energy."""
    energy = np.abs(lines.elevation[lines.omega <= highest]) ** 2
    fraction = np.cumsum(energy) / np.sum(energy)
    selected = np.flatnonzero((fraction > lost) & (np.concatenate([[0.0], fraction[:-1]]) < 1 - lost))
    return np.array_split(selected, min(MOST_COMPONENTS, selected.size))


def _gathered(lines: _Lines, groups: list[NDArray[np.int_]]) -> tuple[Vector, Vector]:
    """Return frequencies and amplitudes of groups of lines."""
    energies = np.abs(lines.elevation) ** 2
    energy = np.array([np.sum(energies[group]) for group in groups])
    mean = np.array([energies[group] @ lines.omega[group] for group in groups]) / energy
    return mean, np.sqrt(energy)


def _travel(end: EndWall, k: Vector, energy: Vector, squares: Vector) -> travel.Propagation:
    """Return the travel of components to the farthest gauge they reach, of energies generated at rates, shape (N, M).

    The fraction is 0 of those that reach none; where gauges are reached by less than ``REACHED`` of the energy, the
    rest being on its way to them, all travel along the tank.
    """
    tank, duration = end.tank, end.duration
    speed = airy.group_velocity(k, tank.depth, tank.gravity)
    at = travel.reflections(end, airy.angular_frequency(k, tank.depth, tank.gravity))
    x = np.array([float(end.distance(gauge.x)) for gauge in end.case.all_gauges])
    reached = np.divide.outer(x, speed) < duration
    everywhere = energy @ np.any(reached, axis=0) < REACHED * energy.sum()
    farthest = np.full_like(k, tank.length) if everywhere else np.where(reached, x[:, None], 0.0).max(axis=0)
    generated = travel.Generation.of(
        squares, duration=max(duration, analysed_duration(end, end.motion())), until=duration
    )
    result = travel.travel(farthest, speed, length=tank.length, at=at, generated=generated, duration=duration)
    if everywhere:
        along = np.minimum(duration, tank.length / speed)
        return result._replace(age=np.maximum(result.age, along), fraction=np.maximum(result.fraction, 1.0))
    return result._replace(fraction=np.where(np.any(reached, axis=0), result.fraction, 0.0))


STARTS: dict[type[Any], Callable[[Any, Case], list[CaseWaves]]] = {  # initial states of plans, and their waves
    nouns.StillWater: lambda initial, scene: [],
    nouns.StandingWave: _standing_wave,
    nouns.StreamFunctionWave: lambda wave, scene: [
        _steady_waves(wave.wave(scene.tank), scene.tank.length / wave.waves, scene)
    ],
    nouns.SolitaryWave: lambda wave, scene: [
        _followed(wave.wave(scene.tank), wave.height, scene, distance=scene.tank.length - wave.x)
    ],
}
