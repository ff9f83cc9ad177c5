"""Requirements of a case: its waves, how long they travel, their steepness, run-up and absorption.

**The waves of a paddle** are those of linear wavemaker theory (``paddle_waves.py``). The age of a standing wave is the
duration of the run.

**Steepness** is that of the highest crest a of the waves of one direction, in Stokes' expansion with s = k a and sigma
= tanh(k d):

    a_2 / a_1 = s (3 - sigma²) / (4 sigma³),     a_3 / a_1 = s² (27 - 9 sigma² + 9 sigma⁴ - 3 sigma⁶) / (64 sigma⁶),
    omega / omega_linear - 1 = s² (9 - 10 sigma² + 9 sigma⁴) / (16 sigma⁴).

Waves of permanent form are exact: their harmonics, speed and velocity are those of the wave itself. A solitary wave is
treated as periodic in a window around its crest. Standing waves have the crest, harmonics and frequency of their own
expansion (``standing_harmonics``). Their initial state has no bound harmonics; the free harmonics that compensate for
these cause a beat: with k a = 0.3, k d = pi / 2 the crest reaches 1.45 a, that of a travelling wave 1.15 a.

**The run-up of a solitary wave** at a vertical wall has a peak narrower than the wave. With run-up R, depth d and
relative wave height h = H / d, its curvature at the wall is -R / l², and

    l / d = (2 / (3 h))^(1/2) (1 - (3 h / 2)²),     R / d = 2 h + h² / 2 + 3 h³ / 4.

The first factor of l is that of the sech² profile. The second is fitted to converged runs of h = 0.05 to 0.6 (within 2
%, at 0.6 6 %); it vanishes at h = 2/3, where the run-up ends in a thin jet. Its error is predicted in
``prediction.py``.

Sources: G. B. Whitham, Linear and Nonlinear Waves, 1974, section 13.13; R. G. Dean and R. A. Dalrymple 1991, chapter
11; I. Tadjbakhsh and J. B. Keller, J. Fluid Mech. 8, 1960 (standing waves); R by C. H. Su and R. M. Mirie, "On head-on
collisions between two solitary waves", J. Fluid Mech. 98, 1980.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError, Problem
from wavetank.base.errors import InputError
from wavetank.case import Case, EndWall, Physics, RingTank
from wavetank.case import initial as starts
from wavetank.case.paddle import SolitaryWaveMotion
from wavetank.case.tank import BasinTank
from wavetank.planning.paddle_waves import NOISE, CaseWaves, Form, RunUp, WaveComponents, paddle_waves
from wavetank.waves import airy
from wavetank.waves.conformal import SteadyWave
from wavetank.waves.solitary_wave import solitary_wave

PLANNED_STARTS = (
    starts.SolitaryWave,
    starts.StandingWave,
    starts.StillWater,
    starts.StreamFunctionWave,
)  # initial states of cases that can be planned
MAX_RUN_UP_HEIGHT = 0.6  # H / d of the highest run-up that was computed with two meshes within 0.02 %
ABSORPTION = 2.5  # C; measured 1.6 to 3.5: pistons at k d = 0.7, 1.5, 2.5, flaps at 0.7, 1.5, 28 and 40 steps a period
POINTS = 1024  # points of a wave of permanent form
TAIL, MAX_TAIL = 1e-3, 60.0  # end of the window of a solitary wave: elevation over the height, distance in depths
FURTHER_HARMONICS = 4  # harmonics of a standing wave beyond those of its expansion
DECAY = 1.85  # r_(m+1) / r_m of these over r_3 / r_2; 1.83 to 1.95 in runs of k a = 0.15 to 0.3 (docs/plan.md)
MIN_HARMONIC = 1e-5  # amplitude over that of the first harmonic


def stokes_harmonics(steepness: float, kd: float) -> tuple[Vector, float]:
    """Return Stokes' harmonics of a wave of steepness k a in depth k d, and the relative change of its frequency.

    The harmonics are the first four amplitudes relative to the first, at most 1, shape (4,); a_4 = a_3² / a_2.
    """
    s, sigma = steepness, np.tanh(kd)
    second = s * (3 - sigma**2) / (4 * sigma**3)
    third = s**2 * (27 - 9 * sigma**2 + 9 * sigma**4 - 3 * sigma**6) / (64 * sigma**6)
    excess = s**2 * (9 - 10 * sigma**2 + 9 * sigma**4) / (16 * sigma**4)
    return np.minimum([1.0, second, third, third**2 / second], 1.0), float(excess)


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Requirements of a case for an accuracy.

    Attributes
    ----------
    case, accuracy
        The case, and the largest relative error of the elevation.
    waves
        The components.
    k, crest
        Wave number of the mean energy [rad/m], and highest crest of the components by linear theory [m].
    form
        Form of the waves; in linear water the first harmonic without current.
    steep_time
        Time for which the waves are about as high [s].
    run_up
        Highest run-up of a solitary wave at a wall; None if there is none.
    physics
        "linear" or "nonlinear".
    reasons
        Required parts of the model and the reasons, one sentence each.
    """

    case: Case
    accuracy: float
    waves: WaveComponents
    k: float
    crest: float
    form: Form
    steep_time: float
    run_up: RunUp | None
    physics: Physics
    reasons: tuple[str, ...]


def unplanned(case: Case) -> str | None:
    """Return why a case's tank or initial state cannot be planned, or None."""
    tank, allowed = case.tank, "slices and rings with a flat bed"
    if tank.bed is not None:
        return f'tank.bed.type = "{tank.bed.type}": plans are made for {allowed}'
    if isinstance(tank, BasinTank):
        return f'tank.type = "{tank.type}": plans are made for {allowed}'
    if type(case.initial) not in PLANNED_STARTS:
        allowed = ", ".join(kind.model_fields["type"].default for kind in PLANNED_STARTS)
        return f'initial.type = "{case.initial.type}": plans are made for {allowed}'
    return None


def requirements(case: Case, accuracy: float) -> Requirements:
    """Return the requirements of a case for a relative error ``accuracy`` of the elevation; water that is set stays.

    Raises ``InputError`` for a case in which nothing moves, or whose tank or initial state cannot be planned.
    """
    if why := unplanned(case):
        allowed = f"must be left out, then cells and vertical order follow a rule: {why}"
        raise CaseError([Problem(("numerics", "accuracy"), case.numerics.accuracy, allowed)])
    depth, total = case.tank.depth, _all_waves(case, accuracy)
    waves, energy = total.components, total.components.amplitude**2
    k = float(energy @ waves.k / energy.sum())
    form = total.form or Form(
        *stokes_harmonics(k * total.progressive, k * depth), _crest_velocity(k, total.crest, case), total.crest
    )
    second = form.harmonics[1]
    phase = float(form.excess * (energy @ (waves.omega * waves.age)) / energy.sum())
    enough = bool(np.hypot(second, phase) <= accuracy)  # linear water
    physics, choice = case.physics, f"{case.physics}, as the case says"
    if case.water is None and case.output.velocity_every is None:  # linear water has no velocities to be recorded
        physics = choice = "linear" if enough else "nonlinear"
    if physics == "nonlinear":
        waves = WaveComponents(*np.hstack([waves, total.free]))
    else:
        form = form._replace(harmonics=np.ones(1), velocity=0.0)
    misses = f"a second harmonic of {second:.2g} of the first and {abs(phase):.2g} rad of phase"
    limit = f"{'at most' if enough else 'more than'} the accuracy of {accuracy:g}"
    reasons = [
        f"footprint: a {case.tank.type}, the case has one horizontal dimension.",
        f"bed: flat, the depth is {depth:g} m everywhere; k d = {k * depth:.3g}.",
        f"water: {choice}; at k a = {k * total.crest:.3g} linear theory misses {misses}, {limit}.",
        *_wall_reasons(case, waves),
    ]
    if total.run_up is not None:
        peak = f"about {total.run_up.elevation:.3g} m with a peak of length {total.run_up.length:.3g} m"
        reasons.append(f"run-up: the solitary wave meets a wall; {peak} decides on cells and vertical order, too.")
    return Requirements(
        case=case,
        accuracy=accuracy,
        waves=waves,
        k=k,
        crest=total.crest,
        form=form,
        steep_time=total.steep_time,
        run_up=total.run_up,
        physics=physics,
        reasons=tuple(reasons),
    )


def absorption_error(case: Case, k: Vector) -> Vector:
    """Return the reflection error of waves of wave numbers k [rad/m] over (omega dt)^(7/2), shape (N,).

    It is zero before waves have returned to the farthest gauge. Of several paddles the largest error counts.
    """
    if not case.absorbing:
        return np.zeros_like(k)
    depth, length = case.tank.depth, case.tank.length
    path = 2 * length - max((gauge.x for gauge in case.all_gauges), default=length)
    back = path / airy.group_velocity(k, depth, case.tank.gravity)
    least = np.min([case.paddles[n].wall.wavemaker.transfer(k, depth) for n in case.absorbing], axis=0)
    return np.asarray(ABSORPTION * least**-1.5 * np.sqrt(np.maximum(0.0, 1.0 - back / case.run.duration)))


def _crest_velocity(k: float, crest: float, case: Case) -> float:
    tank = case.tank
    return float(crest * airy.angular_frequency(k, tank.depth, tank.gravity) / np.tanh(k * tank.depth))


# ---------------------------------------------------------------- the walls
def absorption(end: EndWall) -> str:
    """Return a description of a paddle's absorption; empty if it does not absorb."""
    return "" if end.wall.absorb is None else str(end.wall.absorb.description(end))


def _paddle_reason(end: EndWall) -> str:
    order, linear = end.generation
    drive = f", the waves come from its motion{f' by {order} generation' if order else ''}"
    drive += f", as {linear}" if linear else ""
    if end.motion().interval is not None:
        drive = f" with a measured motion; short waves below {NOISE:.1%} count as its noise"
    elif not end.motion().moves:
        drive = " that is not driven"
    absorbs = absorption(end)
    return f"a {end.wall.type}{drive}{f'; {absorbs}' if absorbs else ''}"


def _wall_reasons(case: Case, waves: WaveComponents) -> tuple[str, str]:
    """Return the reasons for the wall at x = 0 and for the far end."""
    if isinstance(case.tank, RingTank):
        return "wall at x = 0: none in a ring.", "far end: none, a ring needs no sponge."
    first, far = (_paddle_reason(end) if end.wall.moves else "" for end in case.ends)
    energy = waves.amplitude**2
    if case.sponge is not None:
        far = f"a sponge (type {case.sponge.type}) absorbs what comes; what it reflects is not planned for"
    elif not far:
        age = float(np.sqrt(energy @ waves.age**2 / energy.sum()))
        far = f"a wall that reflects; waves are followed for {age:.3g} s (root mean square)"
    return f"wall at x = 0: {first or 'fixed, nothing moves there'}.", f"far end: {far}."


# ---------------------------------------------------------------- the waves
def _all_waves(case: Case, accuracy: float) -> CaseWaves:
    every = [*_initial_waves(case), *(_waves_of(end, accuracy) for end in case.paddles if end.period is not None)]
    if not any(waves.crest > 0.0 for waves in every):
        raise InputError("the case: nothing moves in it; a plan needs a wave or a paddle that moves.")
    run_ups = [waves.run_up for waves in every if waves.run_up is not None]
    return CaseWaves(
        WaveComponents(*np.hstack([waves.components for waves in every])),
        crest=sum(waves.crest for waves in every),
        progressive=sum(waves.progressive for waves in every),
        steep_time=max(waves.steep_time for waves in every),
        free=WaveComponents(*np.hstack([waves.free for waves in every])),
        form=next((waves.form for waves in every), None),
        run_up=max(run_ups, default=None),
    )


def _waves_of(end: EndWall, accuracy: float) -> CaseWaves:
    """Return the waves of a paddle."""
    if isinstance(motion := end.wall.motion, SolitaryWaveMotion):
        exact = solitary_wave(motion.height, depth=end.tank.depth, gravity=end.tank.gravity)
        arrival = motion.crest_time_in(end.tank) + end.tank.length / exact.speed
        return _solitary_wave(exact, motion.height, end.case, arrival, end.opposite)
    return paddle_waves(end, accuracy)


def _initial_waves(case: Case) -> Iterator[CaseWaves]:
    tank = case.tank
    match case.initial:
        case starts.StandingWave() as wave:
            yield _standing_wave(wave, case)
        case starts.StreamFunctionWave() as wave:
            yield _steady_waves(wave.wave(tank), tank.length / wave.waves, case)
        case starts.SolitaryWave() as wave:
            exact = wave.wave(tank)
            yield _solitary_wave(exact, wave.height, case, (tank.length - wave.x) / exact.speed, case.far_wall)


def _standing_wave(wave: starts.StandingWave, case: Case) -> CaseWaves:
    tank, a = case.tank, wave.wave_amplitude
    k = wave.mode * np.pi / tank.length * np.arange(1, 3)  # the free part of the second harmonic
    in_space, excess = standing_harmonics(float(k[0]) * a, float(k[0]) * tank.depth)
    sizes = np.linalg.norm(in_space * [1.0, *3 * [np.sqrt(0.5)]], axis=1)  # times for means over a period
    ratios = np.minimum(sizes / sizes[0], 1.0)
    beyond = np.minimum(DECAY * ratios[-1] / ratios[-2], 1.0) ** np.arange(1, FURTHER_HARMONICS + 1)
    ratios = np.append(ratios, ratios[-1] * beyond)
    omega, age = airy.angular_frequency(k, tank.depth, tank.gravity), np.full(2, case.run.duration)
    form = Form(ratios, excess, _crest_velocity(float(k[0]), a, case), a * (2 * float(in_space.sum()) - 1.0))
    return CaseWaves(WaveComponents(np.asarray(k), omega, a * ratios[:2], age), a, form=form)


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


def _solitary_wave(exact: SteadyWave, height: float, case: Case, arrival: float, wall: object) -> CaseWaves:
    """Return a solitary wave of a height [m] whose crest reaches a wall at a time [s]."""
    depth = case.tank.depth
    x = depth * np.linspace(0.0, MAX_TAIL, POINTS)
    half = float(x[np.flatnonzero(exact.elevation(exact.crest + x) > TAIL * height)[-1]])
    waves = _steady_waves(exact, 2 * half, case)
    if case.sponge is not None or getattr(wall, "absorb", None) is not None or arrival >= case.run.duration:
        return waves
    h = min(height / depth, MAX_RUN_UP_HEIGHT)
    length = depth * float(np.sqrt(2 / (3 * h))) * (1 - (1.5 * h) ** 2)
    return waves._replace(run_up=RunUp(depth * (2 * h + h**2 / 2 + 0.75 * h**3), length, depth))


def _steady_waves(exact: SteadyWave, length: float, case: Case) -> CaseWaves:
    """Return a wave of permanent form by its harmonics in a window of a length [m] around its crest."""
    tank, k = case.tank, np.array([2 * np.pi / length])
    x = length / POINTS * np.arange(POINTS)
    eta, psi = exact.surface(exact.crest + np.where(x > length / 2, x - length, x))
    amplitudes = 2 / POINTS * np.abs(np.fft.rfft(eta))[1:]
    selected = 1 + int(np.flatnonzero(amplitudes > MIN_HARMONIC * amplitudes[0])[-1])
    velocity = float(psi[1] * POINTS / length)  # the surface is level at the crest, and psi is odd
    excess = exact.speed * float(k[0] / airy.angular_frequency(k, tank.depth, tank.gravity)[0]) - 1.0
    components = WaveComponents(k, exact.speed * k, amplitudes[:1], np.array([case.run.duration]))
    form = Form(amplitudes[: max(selected, 2)] / amplitudes[0], excess, velocity, float(eta.max()))
    return CaseWaves(components, form.crest, form=form)
