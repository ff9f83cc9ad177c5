"""The analyses of ``wavetank analyse``: of a record a table, notes, and what its figure shows."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from xarray import DataArray, Dataset

from wavetank.analysis.record import Record
from wavetank.analysis.reflection import (
    ENERGETIC,
    FREE,
    WORST,
    Reflection,
    WaveFit,
    beat_length,
    bound_and_free,
    reflected_spectra,
    regular_reflection,
)
from wavetank.analysis.signals import (
    PERIODS,
    SMALLEST,
    envelope,
    groupiness,
    harmonics,
    mean_period,
    phase_speed,
    regular_speed,
    resolved,
    sea_state,
    spectrum,
    time_step,
    travel,
    waves_begin,
    waving,
)
from wavetank.analysis.statistics import forristall_crests, height_statistics, zero_crossing_waves
from wavetank.errors import InputError
from wavetank.waves.airy import group_velocity, wave_number
from wavetank.waves.wave import Array

COHERENT = 0.9  # less has no phase speed
DOUBTFUL = 0.1  # of the variance: more that is not of the period is told
FEWEST_PERIODS = 3  # in a record that is taken for one of regular waves unasked
MIDDLE = 16  # mean periods that are looked at before all of a record is
MANY = 6  # pairs of gauges that are named
SEVERAL = 5  # of a sea's mean periods: over which its height is looked at
SLIGHT, UNSURE = 1e-3, 0.5  # reflection, and part of it: what is uncertain by more is told
UNSTEADY, MINOR = 0.15, 0.05  # of itself, and of all: a harmonic that changes by more than both is told
UNSTEADY_SECOND = 0.1  # of the largest: a bound or free wave that changes by more is told
STEEP = 0.05  # of the wave number: within which that of regular waves is looked for, where gauges allow

Value = str | float


class Result(NamedTuple):
    """A table, its columns' names with units, notes below it, and its figure's name and arguments."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Value]]
    notes: str
    figure: str
    arguments: dict[str, Any]


def _stations(record: Record) -> list[tuple[str, float]]:
    """Return the gauges' names and places x [m]."""
    return [(str(one.gauge.values), float(one.x)) for one in record.eta]


def _rows(record: Record, *columns: ArrayLike) -> list[tuple[Value, ...]]:
    """Return a row for each gauge: its name, its place, and its values in columns of shape (gauges,)."""
    values = np.column_stack([np.asarray(column, dtype=float) for column in columns])
    return [(*station, *map(float, row)) for station, row in zip(_stations(record), values, strict=True)]


def spectra(record: Record) -> Result:
    """Spectra, with Hm0 and the periods that follow from their moments."""
    S = spectrum(record.eta)
    state = sea_state(S)
    names = ("hm0", "tp", "tm01", "tm02", "tm_10")
    rows = _rows(record, *(state[name] for name in names))
    count = S.attrs["segments"]
    text = f"{count} segments" if count > 1 else "the whole record as one segment"
    text += f", {float(S.frequency[1] - S.frequency[0]):.3g} Hz apart"
    columns = ("gauge", "x [m]", "Hm0 [m]", "Tp [s]", "Tm01 [s]", "Tm02 [s]", "Tm-10 [s]")
    return Result(columns, rows, text, "spectrum", {"S": S, "title": record.title})


def heights(record: Record) -> Result:
    """Waves by zero up-crossings, and how often they are higher, beside Rayleigh and Forristall."""
    waves = [(one, zero_crossing_waves(one)) for one in record.eta]
    statistics = [height_statistics(result) for _, result in waves]
    states = sea_state(spectrum(record.eta))
    units = {"waves": "-", "t_mean": "s", "t_1_3": "s"}
    columns = ("gauge", "x [m]", *(f"{name} [{units.get(name, 'm')}]" for name in statistics[0]), "Hm0 [m]")
    rows = _rows(record, [[*one.values()] for one in statistics], states.hm0)
    hm0, tm01, depth = float(states.hm0.mean()), float(states.tm01.mean()), record.optional_depth

    def crests(relative: Array) -> Array:
        return forristall_crests(relative * hm0, hm0, tm01=tm01, depth=depth or np.inf, gravity=record.gravity)

    text = "" if depth else "Forristall's crests are left out: the depth is not known (--depth)"
    try:
        crests(np.ones(1))
    except InputError as error:
        text = f"they are left out; {error}"
    drawn = None if text else crests
    return Result(
        columns, rows, text, "heights", {"waves": waves, "states": states, "second": drawn, "title": record.title}
    )


def harmonic(record: Record) -> Result:
    """Amplitudes and phases of the waves' harmonics."""
    f, number = record.frequency, resolved(record.eta, record.frequency)
    result = harmonics(record.eta, f, number=number)
    A, numbers = result.component.values, result.harmonic.values
    columns = ["gauge", "x [m]", *(f"a{n} [m]" for n in numbers), *(f"phase{n} [rad]" for n in numbers), "rest [m]"]
    rows = _rows(record, np.abs(A), np.angle(A), result.rest)
    unsteady = _unsteady_note(
        record,
        lambda eta: np.abs(harmonics(eta, f, number=number).component.values),
        lambda a: np.maximum(UNSTEADY * a, MINOR * np.linalg.norm(a, axis=1, keepdims=True)),
        [[f"harmonic {n} at gauge {gauge}" for n in numbers] for gauge in record.eta.gauge.values],
    )
    text = _period_note(record) + _others_note(record) + (_begin_note(record, 1 / f) or unsteady)
    return Result(columns, rows, text, "harmonics", {"found": result, "title": record.title})


def bound_free(record: Record) -> Result:
    """The second harmonic along the tank: bound to the first, free, and free that goes back."""
    f, depth, g = record.frequency, record.depth, record.gravity
    names = ["bound", "free", "free, going back"][: 3 if record.eta.sizes["gauge"] > 3 else 2]

    def second(eta: DataArray) -> tuple[DataArray, WaveFit]:
        result = harmonics(replace(record, eta=eta).on_its_way, f, number=max(2, resolved(record.eta, f)))
        component = result.component[:, 1]
        return component, bound_and_free(component, f, depth=depth, gravity=g, returning=len(names) > 2)

    component, result = second(record.eta)
    k, free = (float(one) for one in wave_number(2 * np.pi * f * np.array([1, 2]), depth, g))
    numbers = [2 * k, free, -free][: len(names)]
    rows: list[tuple[Value, ...]] = [
        (name, q, abs(a), float(np.angle(a))) for name, q, a in zip(names, numbers, result.amplitudes, strict=True)
    ]
    badly = ": gauges stand badly, which should be apart by parts of the beat, not by all of it (--gauges, --along)"
    badly = badly if result.condition > WORST else ""
    unsteady = (
        ""
        if badly
        else _unsteady_note(
            record,
            lambda eta: np.abs(second(eta)[1].amplitudes),
            lambda a: UNSTEADY_SECOND * a.max(keepdims=True),
            [f"the {name} wave" for name in ("bound", "free", "returning free")[: len(names)]],
        )
    )
    text = (
        f"T = {1 / f:.6g} s; beat {beat_length(f, depth=depth, gravity=g):.4g} m; "
        f"{_rest_note(component, result)}condition {result.condition:.3g}{badly}{_others_note(record)}"
        f"{_free_waves_note(record, k, free) or unsteady}{record.direction_note}"
    )
    title = f"{record.title}: second harmonic, T = {1 / f:.4g} s"
    return Result(
        ("wave", "k [rad/m]", "amplitude [m]", "phase at x = 0 [rad]"),
        rows,
        text,
        "bound-free",
        {"component": component, "wave_numbers": numbers, "names": names, "found": result, "title": title},
    )


def groups(record: Record) -> Result:
    """The waves' envelope, and how much it varies."""
    around, factor = envelope(record.eta), groupiness(record.eta)
    rows = _rows(record, around.max("time"), around.mean("time"), factor)
    return Result(
        ("gauge", "x [m]", "largest envelope [m]", "mean envelope [m]", "groupiness [-]"),
        rows,
        "groupiness: 0 of regular waves, 1 of a linear random sea",
        "groups",
        {"eta": record.eta, "envelope": around, "groupiness": factor, "title": record.title},
    )


def reflection(record: Record) -> Result:
    """Incident and reflected waves by least squares: of regular waves where a period is told, else of a sea."""
    return _regular(record) if record.given_period else _irregular(record)


def reflection_coefficient(record: Record) -> float:
    """Return reflected over incident amplitude: of regular waves where a period is told, else of a sea.

    Raises ``InputError`` where the gauges cannot tell.
    """
    waving(record.eta)
    if record.given_period:
        _, result = _separate(record)
        if result.condition > WORST:
            raise InputError("reflection: the gauges stand where incident and reflected waves cannot be told apart.")
        return result.coefficient
    return float(reflected_spectra(record.on_its_way, depth=record.depth, gravity=record.gravity).attrs["coefficient"])


def _separate(record: Record) -> tuple[DataArray, Reflection]:
    """Return the harmonics over gauge, and the waves that the first is told to be.

    They are all that can be found: over a part of a period what is left out would count as the first.
    """
    f = record.frequency
    component = harmonics(record.on_its_way, f, number=resolved(record.eta, f)).component
    within = STEEP if component.sizes["gauge"] > 2 else 0.0
    return component, regular_reflection(component[:, 0], f, depth=record.depth, gravity=record.gravity, within=within)


def _regular(record: Record) -> Result:
    component, result = _separate(record)
    begin = _begin_note(record, 1 / record.frequency)
    badly = ": gauges stand badly" if result.condition > WORST else ""
    text = f"{_rest_note(component, result)}condition {result.condition:.3g}{badly}{_others_note(record)}"
    return Result(
        ("period [s]", "k [rad/m]", "incident [m]", "reflected [m]", "reflection [-]"),
        [(1 / record.frequency, result.k, abs(result.incident), abs(result.reflected), result.coefficient)],
        text + (begin or badly or _uncertainty_note(record, component, result)) + record.direction_note,
        "regular-reflection",
        {"component": component[:, 0], "found": result, "title": record.title},
    )


def _unsteady_note(
    record: Record, amplitudes: Callable[[DataArray], Array], least: Callable[[Array], Array], names: ArrayLike
) -> str:
    """Return which of some named amplitudes [m] changes most over the record, where by more than ``least`` of it."""
    early, whole, late = (amplitudes(eta) for eta in _whole_periods(record))
    change = np.ptp([early, whole, late], axis=0) / np.maximum(least(whole), SMALLEST)
    if not change.max() > 1.0:
        return ""
    worst = np.unravel_index(np.argmax(change), change.shape)
    return _not_steady(np.asarray(names)[worst], *(f"{amplitude[worst]:.3g} m" for amplitude in (early, late)))


def _not_steady(what: str, early: str, late: str) -> str:
    two = f"{early} in the first half of this record, {late} in the second"
    return f"; {what} is not steady, {two}: a later --start tells it, or a longer record"


def _ends(eta: DataArray, times: int) -> list[DataArray]:
    """Return the first and the last so many times of a record."""
    return [eta.isel(time=slice(times)), eta.isel(time=slice(-times, None))]


def _whole_periods(record: Record) -> list[DataArray]:
    """Return as many whole periods of a record as its half has, the first, all, the last; all where these are few.

    Over a part of a period what is above the highest harmonic counts as others.
    """
    step, period = time_step(record.eta), 1 / record.frequency
    periods = int((record.eta.time.size - 1) * step / period / 2)
    times = 1 + math.ceil(periods * period / step) if periods > 1 else record.eta.time.size
    first, last = _ends(record.eta, times)
    return [first, record.eta, last]


def _uncertainty_note(record: Record, component: DataArray, found: Reflection) -> str:
    """Return why the reflection of the waves that are ``found`` of harmonics is not to be trusted, and what helps.

    Because it changes, or gauges cannot tell it from what linear theory leaves out of the first harmonic. Three see
    that in what they leave; two leave nothing, and it is about as much as the second harmonic is steep.
    """
    doubtful = max(UNSURE * found.coefficient, SLIGHT)
    halves = [replace(record, eta=half) for half in _ends(record.eta, record.eta.time.size // 2)]
    if all(np.ptp(half.eta.time.values) * record.frequency > 1 for half in halves):
        early, late = (_separate(half)[1].coefficient for half in halves)
        if np.ptp([early, found.coefficient, late]) > doubtful:
            return _not_steady("the reflection", *(_percent(part, 2) for part in (early, late)))
    number, steepness = component.sizes["gauge"], found.k * float(np.linalg.norm(component[:, 1:2])) / np.sqrt(2)
    rest = found.rest / max(abs(found.incident), np.finfo(float).tiny)
    left = rest * np.sqrt(2 / (2 * number - 5)) if number > 2 else steepness
    if (unsure := left * (found.condition + 1 / found.condition) / 2) <= doubtful:
        return ""
    why = "the gauges leave of the waves: more of them tell it better"
    if number == 2:
        why = "two gauges cannot tell from free harmonics and steepness: three can"
    return f"; the reflection is uncertain by {_percent(unsure, 1)}, which {why} (--gauges, --along)"


def _rest_note(component: DataArray, found: WaveFit | Reflection) -> str:
    """Return what waves told apart leave of complex amplitudes over gauge, which of two gauges is nothing."""
    return f"rest {found.rest:.3g} m (rms); " if component.sizes["gauge"] > 2 else ""


def _percent(part: float, digits: int) -> str:
    """Return a part in so many digits, and never with an exponent."""
    return f"{float(f'{100 * part:.{digits}g}'):g} %"


def _period_note(record: Record) -> str:
    return f"T = {1 / record.frequency:.6g} s" + ("" if record.given_period else ", as found in the record (--period)")


def _other_variance_ratio(record: Record) -> float:
    """Return how much of the variance is neither of the waves' frequency nor of its harmonics."""
    rest = harmonics(record.eta, record.frequency, number=resolved(record.eta, record.frequency)).rest
    return float((rest**2).sum() / record.eta.var("time").sum())


def _others_note(record: Record) -> str:
    """Return words on the variance that is neither of the waves' frequency nor of its harmonics, where that is much."""
    fraction = _other_variance_ratio(record)
    others = f"; {_percent(fraction, 2)} of the variance is not of this period, but of other waves or of growing ones"
    return others if fraction > DOUBTFUL else ""


def _begin_note(record: Record, period: float) -> str:
    """Return how to leave out the beginning of the waves, looked at over a period [s], where the record has it."""
    start = waves_begin(record.eta, period)
    return "" if start is None else f"; its waves begin in this record: --start {start:.4g} leaves that out"


def _free_waves_note(record: Record, k: float, free: float) -> str:
    """Return from when on free second harmonics of wave number ``free`` [rad/m] are at all gauges, if that is later.

    They leave the wall with the first harmonic, of wave number k [rad/m], or where no wall is known, or a bed may make
    them, the first gauge at the latest. The beginning is looked for before the record's start, too.
    """
    whole, period = record.eta if record.before is None else record.before, 1 / record.frequency
    if (begin := waves_begin(whole, period)) is None:
        return ""
    first, second = (float(group_velocity(q, record.depth, record.gravity)) for q in (k, free))
    x = record.on_its_way.x.values
    way = x.max() if record.from_wall else np.ptp(x)
    start = begin + float(way) * (1 / second - 1 / first)
    if record.eta.time[0] > start - period / 2:
        return ""
    enough = record.eta.time[-1] > start + period
    advice = f"--start {start:.4g} leaves out what is before" if enough else "the record is too short for it"
    return f"; the free second harmonic, which is slower, has come to all gauges by {start:.4g} s: {advice}"


def _irregular(record: Record) -> Result:
    result = reflected_spectra(record.on_its_way, depth=record.depth, gravity=record.gravity)
    of = ("hm0_incident", "hm0_reflected", "coefficient", "told_apart")
    enough = f"{2 * PERIODS * mean_period(record.eta):.3g} s"
    one = f"; the record is one window, whose middle counts most: of {enough} it would be several"
    return Result(
        ("Hm0 incident [m]", "Hm0 reflected [m]", "reflection [-]", "variance told apart [-]"),
        [tuple(float(result.attrs[name]) for name in of)],
        f"{record.eta.sizes['gauge']} gauges; reflection of frequencies that they resolve, that have above "
        f"{100 * ENERGETIC:g} % of the largest density and are below {result.attrs['highest_frequency']:.3g} Hz, "
        f"{FREE:g} times the peak's (harmonics above are bound waves); Hm0 of all frequencies, in that ratio"
        f"{one if result.attrs['one_window'] else ''}{record.direction_note}"
        f"{_begin_note(record, SEVERAL * mean_period(record.eta))}",
        "reflection",
        {"found": result, "title": record.title},
    )


def speed(record: Record) -> Result:
    """How fast waves go from gauge to gauge: regular ones by their phase, others by cross-correlation, too."""
    return _speed_of_regular(record) if _is_regular(record) else _speed_of_sea(record)


def _is_regular(record: Record) -> bool:
    """Return whether a period is told, or one that is found has nearly all of the variance."""
    if record.given_period:
        return True
    times, some = record.eta.time.size, round(MIDDLE * mean_period(record.eta) / time_step(record.eta))
    middle = record.eta.isel(time=slice(max(0, (times - some) // 2), (times + some) // 2))
    # most of what is not regular is not in its middle either, which takes no time
    return all(_of_one_period(replace(record, eta=part)) for part in (middle, record.eta))


def _of_one_period(record: Record) -> bool:
    if not record.eta.var("time").max() > SMALLEST**2:
        return False
    length = float(record.eta.time[-1] - record.eta.time[0])
    return record.frequency * length > FEWEST_PERIODS and _other_variance_ratio(record) < DOUBTFUL


def _speed_of_regular(record: Record) -> Result:
    f = record.frequency
    component = harmonics(record.on_its_way, f, number=resolved(record.eta, f)).component[:, 0]
    result = regular_speed(component, f, depth=record.depth, gravity=record.gravity)
    linear = 2 * np.pi * f / float(wave_number(2 * np.pi * f, record.depth, record.gravity))
    pairs, distance, late, c = (result[name].values for name in ("pair", "distance", "delay", "speed"))
    return Result(
        ("gauges", "distance [m]", "delay [s]", "phase speed [m/s]", "linear [m/s]"),
        [(str(pair), *map(float, row), linear) for pair, *row in zip(pairs, distance, late, c, strict=True)],
        f"{_period_note(record)}; of delays that differ by whole periods the one nearest to linear waves' is told"
        f"{_uncertain(result, 'they differ by more than a quarter of one')}{_others_note(record)}"
        f"{_begin_note(record, 1 / f)}{record.direction_note}",
        *_speed_figure(record, c[:, None], pairs, np.array([f])),
    )


def _speed_figure(record: Record, c: Array, pairs: Array, frequencies: Array) -> tuple[str, dict[str, Any]]:
    """Return name and arguments of the figure of phase speeds [m/s], shape (pairs, frequencies)."""
    arguments = {"speed": c, "pairs": list(pairs), "frequencies": frequencies, "title": record.title}
    return "speed", {**arguments, "depth": record.depth, "gravity": record.gravity}


def _speed_of_sea(record: Record) -> Result:
    eta = record.on_its_way
    result, between = phase_speed(eta, depth=record.depth, gravity=record.gravity), travel(eta)
    density, frequencies = result.density.values, result.frequency.values
    told = (result.coherence.values > COHERENT) & (density > ENERGETIC * density.max(axis=1, keepdims=True))
    told &= result.own.values
    if not told.any():
        raise InputError(f"{record.title}: from gauge to gauge no frequency has a coherence of {COHERENT:g}.")
    peak = np.argmax(np.where(told, density, 0.0), axis=1)
    f, c = frequencies[peak], result.speed.values[np.arange(peak.size), peak]
    linear = 2 * np.pi * f / wave_number(2 * np.pi * f, record.depth, record.gravity)
    columns = ["gauges", "distance [m]", "delay [s]", "speed [m/s]"]
    columns += ["peak [Hz]", "phase speed there [m/s]", "linear [m/s]"]
    numbers = np.column_stack([between.distance, between.delay, between.speed, f, c, linear])
    return Result(
        columns,
        [(str(pair), *map(float, row)) for pair, row in zip(between.pair.values, numbers, strict=True)],
        "delay and speed are those of the largest cross-correlation"
        f"{_uncertain(between, 'a period earlier or later the records are as alike')}"
        f"; frequencies are {frequencies[0]:.3g} Hz apart{record.direction_note}",
        *_speed_figure(record, result.speed.where(told).values, result.pair.values, frequencies),
    )


def _uncertain(found: Dataset, why: str) -> str:
    """Return words on pairs of gauges between which whole periods cannot be told."""
    pairs = found.pair.values[~found.certain.values]
    some = ", ".join(map(str, pairs[:MANY])) + (f" and {pairs.size - MANY} more" if pairs.size > MANY else "")
    return f"; whole periods cannot be told between gauges {some}: {why}" if pairs.size else ""


def analysed(kind: str, record: Record) -> Result:
    """Return the result of an analysis of one of ``KINDS``; raises ``InputError`` for a gauge without waves, too."""
    waving(record.eta)
    return KINDS[kind](record)


KINDS: dict[str, Callable[[Record], Result]] = {
    "spectrum": spectra,
    "heights": heights,
    "harmonics": harmonic,
    "bound-free": bound_free,
    "groups": groups,
    "reflection": reflection,
    "speed": speed,
}
