"""Motion files for the controllers of wave boards."""

from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.interpolate import BPoly

from wavetank.base.console import console
from wavetank.base.errors import InputError
from wavetank.base.mpi import on_first
from wavetank.case import EndWall
from wavetank.case.reading import read_case
from wavetank.case.wall import HingedWall
from wavetank.motion.motion import Array, Extent, extent, times
from wavetank.output.columns import paddle_columns

MAX_ROWS = 10**7
ROWS, MIN_WAVE = 20, 0.1  # least rows in the shortest period; least wave that counts, relative to the stroke
REST = 1e-3  # final speed, relative to the largest, below which a signal ends at rest


def write_motion(
    case_file: Path, out: Path | None, rate: float, form: str, overrides: list[str], *, ramp_down: bool
) -> None:
    """Write the motion of each paddle of a case; see ``command.motion``."""
    case = read_case(case_file, overrides)
    moving = [view for view in case.paddles if view.motion().moves]
    if not moving:
        raise InputError(f"{case_file}: no paddle moves in it; a wall with a motion is needed.")
    path = Path(f"{case_file.stem}-paddle.{form}") if out is None else out
    for n, view in enumerate(moving):
        file = path.with_stem(f"{path.stem}-far") if n else path
        signal, end = _signal(view, rate, ramp_down=ramp_down)
        t, needs = np.arange(signal.shape[1]) / rate, [_largest(view, signal)]
        if heights := _heights(view):
            needs.append("position {:.4g} m above the bed, {:.4g} m above the hinge".format(*heights))
        on_first(MPI.COMM_WORLD, partial(_write, file, view, t, signal, form, "; ".join(needs)))
        prefix = f"{view.key}: " if len(moving) > 1 else ""
        absorbs = view.wall.absorb is not None
        needs[0] = prefix + needs[0] + (" (without what absorbing adds, which only a run knows)" if absorbs else "")
        ramp = [f"ramp-down to rest within {t[-1] - end:.4g} s after the run"] if t[-1] > end else []
        lines = [*needs, *ramp, *_rate_warning(view, rate), f"wrote {file}: {t.size} rows, {rate:g} a second"]
        console().print("\n".join(lines), highlight=False)


def _signal(end: EndWall, rate: float, *, ramp_down: bool) -> tuple[Array, float]:
    """Return position, velocity and acceleration at equal steps, and the time of the last one before a ramp-down.

    Shape (3, T), or (3, T, P) for a paddle of segments, up to the end of the definition of the motion. Raises
    ``InputError`` for too many rows, or a ramp-down beyond the limits of the paddle.
    """
    rows = int(np.ceil(end.duration * rate * (1 - 1e-12))) + 1
    if rows > MAX_ROWS:
        raise InputError(f"--rate {rate:g}: must be at most {MAX_ROWS / end.duration:.4g}, for {MAX_ROWS} rows.")
    t = np.arange(rows) / rate
    t = np.asarray(t[t <= end.motion().duration])
    signal = end.rates(t)
    if not ramp_down or not np.abs(signal[1, -1]).max() > REST * np.abs(signal[1]).max():
        return signal, float(t[-1])
    signal = np.concatenate([signal, _ramp_down(signal, rate)], axis=1)
    limits = end.wall.limits
    for problem in limits.exceeded(extent(signal), end.key, "limits") if limits else ():
        raise InputError(f"{problem} with its ramp-down; --no-ramp-down leaves that out.")
    return signal, float(t[-1])


def _ramp_down(signal: Array, rate: float) -> Array:
    """Return the continuation of a signal to rest at X = 0, a quintic from its last values.

    The length of the quintic minimises its largest values relative to those of the signal.
    """
    last, largest = signal[:, -1], np.abs(signal).reshape(3, -1).max(axis=1)

    def quintic(length: float) -> Array:
        rows = max(2, int(np.ceil(length * rate)))
        position, t = BPoly.from_derivatives([0.0, rows / rate], [last, 0.0 * last]), np.arange(1, rows + 1) / rate
        return np.array([position(t), position.derivative()(t), position.derivative(2)(t)])

    lengths = 2 * np.pi * largest[0] / largest[1] * np.geomspace(0.25, 4.0, 41)
    return min(map(quintic, lengths), key=lambda one: (np.abs(one).reshape(3, -1).max(axis=1) / largest).max())


def _largest(end: EndWall, signal: Array) -> str:
    """Return the signal's largest values and their limits as text."""
    limits, parts = end.wall.limits, []
    both = zip(Extent._fields, ("m", "m/s", "m/s^2"), extent(signal), end.extent, strict=True)
    for name, unit, *pair in both:
        limit = getattr(limits, name, None)
        parts.append(f"{name} {max(pair):.4g} {unit}" + ("" if limit is None else f" (limit {limit:g} {unit})"))
    return ", ".join(parts)


def _heights(end: EndWall) -> tuple[float, float] | None:
    """Return the heights of the position of a flap above the bed and above its hinge [m]; None for other paddles."""
    wall = end.wall
    if not isinstance(wall, HingedWall):
        return None
    height = end.tank.depth if wall.stroke_height is None else wall.stroke_height
    return height, height - wall.hinge


def _rate_warning(end: EndWall, rate: float) -> list[str]:
    """Return a warning if the rate gives too few rows in the shortest period of the motion.

    Half a period is the time between two reversals of the motion that differ by more than a tenth of the stroke.
    """
    t = times(min(end.duration, end.motion().duration), 0.01)
    X, v = (one.reshape(t.size, -1)[:, 0] for one in end.rates(t)[:2])
    ends = np.flatnonzero(v[:-1] * v[1:] < 0.0)
    at = t[ends] - v[ends] * (t[ends + 1] - t[ends]) / (v[ends + 1] - v[ends])
    halves = np.diff(at)[np.abs(np.diff(X[ends])) > MIN_WAVE * np.ptp(X)]
    if not halves.size or rate * (period := 2 * float(halves.min())) >= ROWS:
        return []
    few = f"--rate {rate:g} gives {rate * period:.3g} rows in the shortest period, {period:.3g} s"
    return [f"warning: {few}; {ROWS} or more are needed, --rate {ROWS / period:.3g}"]


def _write(path: Path, end: EndWall, t: Array, signal: Array, form: str, needs: str) -> None:
    """Write a signal; raises ``InputError`` if the file exists or cannot be written."""
    places, columns, header = end.wall.places(end.tank), [signal[0]], f"# t [s], position [m]; {needs}"
    if form == "csv":
        columns, names = [*signal], paddle_columns(places)
        if heights := _heights(end):
            at = [""] if places is None else [f"@y={y:.6g}" for y in places]
            columns += [np.arctan(signal[0] / heights[1]), np.full(t.shape, heights[0])]
            names += [*(f"angle{place} [rad]" for place in at), "height of position above bed [m]"]
        header = ",".join(names)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            delimiter = "," if form == "csv" else " "
            table = np.column_stack([t, *columns])
            np.savetxt(file, table, fmt="%.10g", delimiter=delimiter, header=header, comments="")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); --out FILE names another.") from None
