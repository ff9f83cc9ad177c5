"""The analyses of ``wavetank analyse``: table, notes, and arguments of the figure for a record."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from xarray import DataArray, Dataset

from wavetank.analysis import reflection, signals
from wavetank.analysis.calibration import CONFIDENCE, PARTS, calibrate
from wavetank.analysis.record import WaveRecord
from wavetank.analysis.statistics import forristall_crests, height_statistics, zero_crossing_waves
from wavetank.base.errors import InputError
from wavetank.waves.airy import Array, group_velocity, wave_number

MIN_COHERENCE = 0.9  # least coherence of frequencies that have a phase speed
OTHER_PERIODS = 0.1  # part of the variance at other periods above which a note is given
MIN_PERIODS = 3  # least number of periods in a record of regular waves whose period is not given
MAX_NAMED_PAIRS = 6  # largest number of gauge pairs that a note names
ONSET_PERIODS = 5  # mean periods of a sea within which its waves begin
UNCERTAIN, RELATIVELY_UNCERTAIN = (
    1e-3,
    0.5,
)  # uncertainty of a reflection, absolute and relative, above which a note is given
UNSTEADY, UNSTEADY_TOTAL = (
    0.15,
    0.05,
)  # change of a harmonic relative to itself, and to all harmonics, above which a note is given
UNSTEADY_SECOND = 0.1  # relative change of a bound or free wave above which a note is given
WAVE_NUMBER_RANGE = 0.05  # relative range in which the wave number of regular waves is fitted if gauges allow
BADLY = "gauges stand badly"


class Result(NamedTuple):
    """A table, i.e. columns of equal length by names with units, notes, the arguments of the figure, a TOML file."""

    columns: Mapping[str, ArrayLike]
    notes: list[str]
    figure: str
    arguments: dict[str, Any]
    toml: str = ""

    @property
    def text(self) -> str:
        """The notes."""
        return "; ".join(filter(None, self.notes))


def _gauges(record: WaveRecord) -> dict[str, ArrayLike]:
    """Return the first columns of a table over gauges."""
    return {"gauge": record.eta.gauge.values.astype(str), "x [m]": record.eta.x}


# ---------------------------------------------------------------- seas and groups
def spectra(record: WaveRecord) -> Result:
    """Spectra, with Hm0 and the periods by their moments."""
    S = signals.spectrum(record.eta)
    state = signals.sea_state(S)
    names = {"Hm0 [m]": "hm0", "Tp [s]": "tp", "Tm01 [s]": "tm01", "Tm02 [s]": "tm02", "Tm-10 [s]": "tm_10"}
    columns = _gauges(record) | {column: state[name] for column, name in names.items()}
    count = S.attrs["segments"]
    segments = f"{count} segments" if count > 1 else "the whole record as one segment"
    text = f"{segments}, {float(S.frequency[1] - S.frequency[0]):.3g} Hz apart"
    return Result(columns, [text], "spectrum", {"S": S})


def heights(record: WaveRecord) -> Result:
    """Zero up-crossing waves, and the exceedance of their heights compared with Rayleigh and Forristall."""
    waves = [(one, zero_crossing_waves(one)) for one in record.eta]
    statistics = [height_statistics(result) for _, result in waves]
    states = signals.sea_state(signals.spectrum(record.eta))
    units = {"waves": "-", "t_mean": "s", "t_1_3": "s"}
    columns = {f"{name} [{units.get(name, 'm')}]": [one[name] for one in statistics] for name in statistics[0]}
    hm0, tm01, depth = float(states.hm0.mean()), float(states.tm01.mean()), record.optional_depth

    def crests(relative: Array) -> Array:
        return forristall_crests(relative * hm0, hm0, tm01=tm01, depth=depth or np.inf, gravity=record.gravity)

    text = "" if depth else "Forristall's crests are left out: the depth is not known (--depth)"
    try:
        crests(np.ones(1))
    except InputError as error:
        text = f"they are left out; {error}"
    arguments = {"waves": waves, "states": states, "second": None if text else crests}
    return Result(_gauges(record) | columns | {"Hm0 [m]": states.hm0}, [text], "heights", arguments)


def groups(record: WaveRecord) -> Result:
    """The envelope of the waves, and its variation."""
    around, factor = signals.envelope(record.eta), signals.groupiness(record.eta)
    largest, mean = around.max("time"), around.mean("time")
    columns = {"largest envelope [m]": largest, "mean envelope [m]": mean, "groupiness [-]": factor}
    arguments = {"eta": record.eta, "envelope": around, "groupiness": factor}
    note = "groupiness: 0 of regular waves, 1 of a linear random sea"
    return Result(_gauges(record) | columns, [note], "groups", arguments)


# ---------------------------------------------------------------- harmonics
def harmonic(record: WaveRecord) -> Result:
    """Amplitudes and phases of the harmonics of the waves."""
    result = record.harmonics.assign_coords(x=record.eta.x)
    A, numbers = result.component.values, result.harmonic.values
    columns = {f"a{n} [m]": a for n, a in zip(numbers, np.abs(A).T, strict=True)}
    columns |= {f"phase{n} [rad]": phase for n, phase in zip(numbers, np.angle(A).T, strict=True)}
    unsteady = _beginning_note(record, 1 / record.frequency) or _unsteady_note(
        record,
        lambda part: np.abs(part.harmonics.component.values),
        lambda a: np.maximum(UNSTEADY * a, UNSTEADY_TOTAL * np.linalg.norm(a, axis=1, keepdims=True)),
        [[f"harmonic {n} at gauge {gauge}" for n in numbers] for gauge in record.eta.gauge.values],
    )
    notes = [_period_note(record), _other_waves_note(record), unsteady]
    return Result(_gauges(record) | columns | {"rest [m]": result.rest}, notes, "harmonics", {"result": result})


def bound_free(record: WaveRecord) -> Result:
    """The second harmonic along the tank: bound, free, and free in the opposite direction."""
    f = record.frequency
    names = ["bound", "free", "free, going back"][: 3 if record.eta.sizes["gauge"] > 3 else 2]

    def second(part: WaveRecord) -> tuple[DataArray, reflection.WaveFit]:
        component = signals.harmonics(part.forward, f, number=max(2, signals.resolved(part.eta, f))).component[:, 1]
        return component, reflection.bound_and_free(component, f, **record.water, returning=len(names) > 2)

    component, result = second(record)
    condition, unsteady = f"condition {result.condition:.3g}", ""
    if result.condition > reflection.MAX_CONDITION:
        condition += f": {BADLY}, which should be apart by parts of the beat, not by all of it (--gauges, --along)"
    else:
        unsteady = _free_waves_note(record, *result.wave_numbers[:2]) or _unsteady_note(
            record,
            lambda part: np.abs(second(part)[1].amplitudes),
            lambda a: UNSTEADY_SECOND * a.max(keepdims=True),
            [f"the {name} wave" for name in ("bound", "free", "returning free")[: len(names)]],
        )
    notes = [
        f"T = {1 / f:.6g} s",
        f"beat {reflection.beat_length(f, **record.water):.4g} m",
        _residual_note(component, result),
        condition,
        _other_waves_note(record),
        unsteady,
        record.direction_note,
    ]
    kind = f"second harmonic, T = {1 / f:.4g} s"
    a, phase = np.abs(result.amplitudes), np.angle(result.amplitudes)
    columns: dict[str, ArrayLike] = {
        "wave": names,
        "k [rad/m]": result.wave_numbers,
        "amplitude [m]": a,
        "phase at x = 0 [rad]": phase,
    }
    return Result(columns, notes, "along", {"component": component, "names": names, "fit": result, "kind": kind})


def _unsteady_note(
    record: WaveRecord, amplitudes: Callable[[WaveRecord], Array], least: Callable[[Array], Array], names: ArrayLike
) -> str:
    """Return a note on the named amplitude [m] with the largest relative change over the record, if above ``least``.

    The first and the last full periods of the record are compared, as many as are in a half: over a part of a period,
    waves above the highest harmonic would distort lower ones.
    """
    step, period = signals.time_step(record.eta), 1 / record.frequency
    periods = int((record.eta.time.size - 1) * step / period / 2)
    halves = _ends(record, 1 + math.ceil(periods * period / step) if periods > 1 else record.eta.time.size)
    early, late = (amplitudes(half) for half in halves)
    full = amplitudes(record)
    change = np.ptp([early, full, late], axis=0) / np.maximum(least(full), signals.MIN_HEIGHT)
    if not change.max() > 1.0:
        return ""
    worst = np.unravel_index(np.argmax(change), change.shape)
    return _not_steady(np.asarray(names)[worst], f"{early[worst]:.3g} m", f"{late[worst]:.3g} m")


def _not_steady(what: str, early: str, late: str) -> str:
    two = f"{early} in the first half of this record, {late} in the second"
    return f"{what} is not steady, {two}: a later --start tells it, or a longer record"


def _ends(record: WaveRecord, times: int) -> list[WaveRecord]:
    """Return the first and the last part of a record, of a number of times each, with its period."""
    parts = (slice(times), slice(-times, None))
    return [replace(record, eta=record.eta.isel(time=part), given_period=1 / record.frequency) for part in parts]


def _free_waves_note(record: WaveRecord, bound: float, free: float) -> str:
    """Return a note on the time at which free second harmonics have reached all gauges, if the record begins earlier.

    The wave number ``free`` [rad/m] is theirs, ``bound`` that of the bound ones, twice that of the first harmonic. They
    start with the waves at the wavemaker or, if it is unknown or a bed may generate them, at the first gauge at the
    latest. The beginning of the waves may be before the start of the record.
    """
    eta, period = record.eta if record.before is None else record.before, 1 / record.frequency
    if (begin := signals.waves_begin(eta, period)) is None:
        return ""
    first, second = (float(group_velocity(q, record.depth, record.gravity)) for q in (bound / 2, free))
    x = record.forward.x.values
    distance = float(x.max() if record.from_wavemaker else np.ptp(x))
    start = begin + distance * (1 / second - 1 / first)
    if record.eta.time[0] > start - period / 2:
        return ""
    enough = record.eta.time[-1] > start + period
    advice = f"--start {start:.4g} leaves out what is before" if enough else "the record is too short for it"
    return f"the free second harmonic, which is slower, has come to all gauges by {start:.4g} s: {advice}"


def _residual_note(component: DataArray, fit: reflection.WaveFit) -> str:
    """Return the residual of waves fitted to complex amplitudes over gauge; empty for two gauges, which have none."""
    return f"rest {fit.rest:.3g} m (rms)" if component.sizes["gauge"] > 2 else ""


def _percent(part: float, digits: int) -> str:
    """Return a fraction as a percentage with a number of digits, never with an exponent."""
    return f"{float(f'{100 * part:.{digits}g}'):g} %"


def _period_note(record: WaveRecord) -> str:
    return f"T = {1 / record.frequency:.6g} s" + ("" if record.given_period else ", as found in the record (--period)")


def _other_variance_ratio(record: WaveRecord) -> float:
    """Return the part of the variance outside the harmonics of the waves."""
    return float((record.harmonics.rest**2).sum() / record.eta.var("time").sum())


def _other_waves_note(record: WaveRecord) -> str:
    """Return a note on the part of the variance outside the harmonics, if it is large."""
    fraction = _other_variance_ratio(record)
    if fraction <= OTHER_PERIODS:
        return ""
    return f"{_percent(fraction, 2)} of the variance is not of this period, but of other waves or of growing ones"


def _beginning_note(record: WaveRecord, period: float) -> str:
    """Return how to exclude the beginning of the waves, over periods [s], if the record contains it."""
    start = signals.waves_begin(record.eta, period)
    return "" if start is None else f"its waves begin in this record: --start {start:.4g} leaves that out"


# ---------------------------------------------------------------- reflection
def reflected_waves(record: WaveRecord) -> Result:
    """Incident and reflected waves by least squares: of regular waves if a period is given, else of a sea."""
    return _regular_reflection(record) if record.given_period else _sea_reflection(record)


def reflection_coefficient(record: WaveRecord) -> float:
    """Return reflected over incident amplitude: of regular waves if a period is given, else of a sea.

    Raises ``InputError`` if the gauges cannot separate them.
    """
    signals.waving(record.eta)
    if not record.given_period:
        return float(reflection.reflected_spectra(record.forward, **record.water).attrs["coefficient"])
    result = _separate(record)
    if result.condition > reflection.MAX_CONDITION:
        raise InputError(
            "incident and reflected waves cannot be told apart at these gauges: their distances must differ."
        )
    return result.reflection


def _separate(record: WaveRecord) -> reflection.WaveFit:
    """Return the incident and reflected wave of the first harmonic."""
    first, within = record.harmonics.component[:, 0], WAVE_NUMBER_RANGE if record.eta.sizes["gauge"] > 2 else 0.0
    return reflection.regular_reflection(first, record.frequency, **record.water, within=within)


def _regular_reflection(record: WaveRecord) -> Result:
    first, result = record.harmonics.component[:, 0], _separate(record)
    badly = f": {BADLY}" if result.condition > reflection.MAX_CONDITION else ""
    uncertainty = _beginning_note(record, 1 / record.frequency)
    if not uncertainty and not badly:
        uncertainty = _uncertainty_note(record, result)
    notes = [
        _residual_note(first, result),
        f"condition {result.condition:.3g}{badly}",
        _other_waves_note(record),
        uncertainty,
        record.direction_note,
    ]
    incident, back = np.abs(result.amplitudes)
    columns: dict[str, ArrayLike] = {
        "period [s]": [1 / record.frequency],
        "k [rad/m]": result.wave_numbers[:1],
        "incident [m]": [incident],
        "reflected [m]": [back],
        "reflection [-]": [result.reflection],
    }
    arguments = {"component": first, "names": ["incident", "reflected"], "fit": result}
    return Result(columns, notes, "along", arguments | {"kind": f"reflection {result.reflection:.3g}"})


def _uncertainty_note(record: WaveRecord, result: reflection.WaveFit) -> str:
    """Return the reason for an uncertain reflection of regular waves, and a remedy; empty if it is certain.

    It is uncertain if it varies, or does not exceed the part of the first harmonic that linear theory omits: the
    residual of three gauges; for two, which have none, the steepness of the second harmonic.
    """
    doubtful = max(RELATIVELY_UNCERTAIN * result.reflection, UNCERTAIN)
    halves = _ends(record, record.eta.time.size // 2)
    if all(np.ptp(half.eta.time.values) * record.frequency > 1 for half in halves):
        early, late = (_separate(half).reflection for half in halves)
        if np.ptp([early, result.reflection, late]) > doubtful:
            return _not_steady("the reflection", *(_percent(part, 2) for part in (early, late)))
    second, number = record.harmonics.component[:, 1:2], record.eta.sizes["gauge"]
    if number > 2:
        error = result.rest / max(abs(result.amplitudes[0]), np.finfo(float).tiny) * np.sqrt(2 / (2 * number - 5))
        why = "the gauges leave of the waves: more of them tell it better"
    else:
        error = result.wave_numbers[0] * float(np.linalg.norm(second)) / np.sqrt(2)
        why = "two gauges cannot tell from free harmonics and steepness: three can"
    if (unsure := error * (result.condition + 1 / result.condition) / 2) <= doubtful:
        return ""
    return f"the reflection is uncertain by {_percent(unsure, 1)}, which {why} (--gauges, --along)"


def _sea_reflection(record: WaveRecord) -> Result:
    result = reflection.reflected_spectra(record.forward, **record.water)
    enough = f"{2 * signals.SEGMENT_PERIODS * signals.mean_period(record.eta):.3g} s"
    one = f"the record is one window, whose middle counts most: of {enough} it would be several"
    notes = [
        f"{record.eta.sizes['gauge']} gauges",
        f"reflection of frequencies that they resolve, above {100 * reflection.MIN_DENSITY:g} % of the largest density "
        f"and below {result.attrs['highest_frequency']:.3g} Hz (harmonics above are bound waves)",
        "Hm0 of all frequencies, in that ratio",
        one if result.attrs["one_window"] else "",
        record.direction_note,
        _beginning_note(record, ONSET_PERIODS * signals.mean_period(record.eta)),
    ]
    columns = {
        "Hm0 incident [m]": [result.attrs["hm0_incident"]],
        "Hm0 reflected [m]": [result.attrs["hm0_reflected"]],
        "reflection [-]": [result.attrs["coefficient"]],
        "resolved variance [-]": [result.attrs["told_apart"]],
    }
    return Result(columns, notes, "reflection", {"result": result})


# ---------------------------------------------------------------- speed
def speed(record: WaveRecord) -> Result:
    """Speed of waves between gauges: of regular waves by their phase, of others also by cross-correlation."""
    return _regular_wave_speed(record) if _is_regular(record) else _sea_speed(record)


def _is_regular(record: WaveRecord) -> bool:
    """Return whether a period is given, or the fitted one contains nearly all of the variance."""
    if record.given_period:
        return True
    if not record.eta.var("time").max() > signals.MIN_HEIGHT**2:
        return False
    length = float(record.eta.time[-1] - record.eta.time[0])
    return record.frequency * length > MIN_PERIODS and _other_variance_ratio(record) < OTHER_PERIODS


def _regular_wave_speed(record: WaveRecord) -> Result:
    f = record.frequency
    result = signals.regular_speed(record.harmonics.component[:, 0], f, **record.water)
    linear = 2 * np.pi * f / float(wave_number(2 * np.pi * f, record.depth, record.gravity))
    c, pairs = result.speed.values, result.pair.values
    columns = {"gauges": pairs, "distance [m]": result.distance, "delay [s]": result.delay}
    columns |= {"phase speed [m/s]": c, "linear [m/s]": np.full_like(c, linear)}
    notes = [
        _period_note(record),
        "the number of periods of a delay follows from the dispersion relation and from closer pairs of gauges",
        _uncertain_note(result, "a gauge between them, or the true depth, resolves it"),
        _other_waves_note(record),
        _beginning_note(record, 1 / f),
        record.direction_note,
    ]
    return Result(columns, notes, "speed", _speed_arguments(record, c[:, None], pairs, np.array([f])))


def _speed_arguments(record: WaveRecord, c: Array, pairs: Array, frequencies: Array) -> dict[str, Any]:
    """Return the arguments of the figure of phase speeds [m/s], shape (pairs, frequencies)."""
    return {"speed": c, "pairs": list(pairs), "frequencies": frequencies} | record.water


def _sea_speed(record: WaveRecord) -> Result:
    eta = record.forward
    result, between = signals.phase_speed(eta, **record.water), signals.travel(eta)
    density, frequencies = result.density.values, result.frequency.values
    counted = (result.coherence.values > MIN_COHERENCE) & (
        density > reflection.MIN_DENSITY * density.max(axis=1, keepdims=True)
    )
    counted &= result.own.values
    if not counted.any():
        raise InputError(f"{record.title}: from gauge to gauge no frequency has a coherence of {MIN_COHERENCE:g}.")
    peak = np.argmax(np.where(counted, density, 0.0), axis=1)
    f, c = frequencies[peak], result.speed.values[np.arange(peak.size), peak]
    linear = 2 * np.pi * f / wave_number(2 * np.pi * f, record.depth, record.gravity)
    columns = {"gauges": between.pair, "distance [m]": between.distance, "delay [s]": between.delay}
    columns |= {"speed [m/s]": between.speed, "peak [Hz]": f, "phase speed there [m/s]": c, "linear [m/s]": linear}
    notes = [
        "delay and speed are those of the largest cross-correlation",
        _uncertain_note(between, "a period earlier or later the correlation is as large"),
        f"frequencies are {frequencies[0]:.3g} Hz apart",
        record.direction_note,
    ]
    arguments = _speed_arguments(record, result.speed.where(counted).values, result.pair.values, frequencies)
    return Result(columns, notes, "speed", arguments)


def _uncertain_note(result: Dataset, why: str) -> str:
    """Return a note on pairs of gauges with an ambiguous number of periods."""
    pairs = result.pair.values[~result.certain.values]
    some = ", ".join(map(str, pairs[:MAX_NAMED_PAIRS])) + (
        f" and {pairs.size - MAX_NAMED_PAIRS} more" if pairs.size > MAX_NAMED_PAIRS else ""
    )
    return f"the delay between gauges {some} is ambiguous by whole periods: {why}" if pairs.size else ""


# ---------------------------------------------------------------- calibration
def calibration(record: WaveRecord) -> Result:
    """Gains, clocks and places of the gauges relative to the first one."""
    result = calibrate(record.forward, **record.water, parts=record.parts)
    gain, clock, place = np.pad(result.corrections, ((0, 0), (1, 0)))
    place = place if record.far_end is None else -place
    of_gain, of_clock, of_place = U = np.pad(result.uncertainty, ((0, 0), (1, 0)), constant_values=np.nan)
    U[[part not in record.parts for part in PARTS]] = np.nan
    factor, names, x = np.exp(gain), record.eta.gauge.values.astype(str), record.eta.x.values
    names_of_misfits = ["misfit", "waves", "fitted", *(f"without {part}" for part in PARTS)]
    columns = {
        "gain [-]": factor,
        "U gain [-]": factor * of_gain,
        "clock [s]": clock,
        "U clock [s]": of_clock,
        "place [m]": place,
        "U place [m]": of_place,
        **dict(zip(names_of_misfits, np.pad(result.misfit, ((0, 0), (1, 0)), constant_values=np.nan), strict=True)),
    }
    notes = [
        f"{len(record.parts) * (names.size - 1)} parameters relative to gauge {names[0]}",
        f"{result.frequency.size} bands from {result.frequency[0]:.3g} to {result.frequency[-1]:.3g} Hz",
        f"U: expanded uncertainties at {100 * CONFIDENCE:g} %",
        record.direction_note,
    ]
    toml = _corrections_text(names, x + place, factor, clock, dict(zip(PARTS, U, strict=True)))
    figure = {"result": result, "names": list(names[1:]), "reference": names[0]}
    return Result(_gauges(record) | columns, notes, "calibration", figure, toml)


def _corrections_text(names: Array, x: Array, gains: Array, clocks: Array, uncertainties: Mapping[str, Array]) -> str:
    """Return corrections of gauges as the keys of a ``dataset.toml``."""
    rows = []
    for n, (name, at) in enumerate(zip(names, x, strict=True)):
        stated = [f"{part} = {of[n]:.2g}" for part, of in uncertainties.items() if np.isfinite(of[n])]
        uncertainty = f", uncertainty = {{ {', '.join(stated)} }}" if stated else ""
        rows.append(f"    {{ name = {json.dumps(str(name))}, x = {at:.4f}{uncertainty} }},")
    lists = (
        f"{key} = [{', '.join(f'{one:.4f}' for one in values)}]"
        for key, values in (("gains", gains), ("clocks", clocks))
    )
    head = f"# Corrections relative to gauge {names[0]}, for a dataset.toml: gains and clocks belong to [[records]]."
    return "\n".join([head, *lists, "gauges = [", *rows, "]", ""])


def analysed(kind: str, record: WaveRecord) -> Result:
    """Return the result of an analysis of one of ``KINDS``; raises ``InputError`` also for a gauge without waves."""
    signals.waving(record.eta)
    result = KINDS[kind](record)
    return result._replace(arguments=result.arguments | {"title": record.title})


KINDS: dict[str, Callable[[WaveRecord], Result]] = {
    "spectrum": spectra,
    "heights": heights,
    "harmonics": harmonic,
    "bound-free": bound_free,
    "groups": groups,
    "reflection": reflected_waves,
    "speed": speed,
    "calibration": calibration,
}
