"""Files of a paddle motion for the controllers of wave boards."""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from scipy.interpolate import BPoly

from wavetank.case import EndWall
from wavetank.case.reading import read_case
from wavetank.case.wall import HingedWall
from wavetank.console import console
from wavetank.errors import InputError
from wavetank.motion.motion import Array, Extent, extent, times
from wavetank.mpi import on_first
from wavetank.output.columns import paddle_columns

MOST = 10**7  # rows
ROWS, SMALL = 20, 0.1  # in the shortest period; of the stroke: smaller waves are not counted
REST = 1e-3  # of the largest speed: a signal that ends so slowly ends at rest


def write_motion(
    case: Path, out: Path | None, rate: float, form: str, overrides: list[str], *, ramp_down: bool
) -> None:
    """Write the motion of each paddle of a case; see ``command.motion``."""
    scene = read_case(case, overrides)
    moving = [view for view in scene.paddles if view.motion().moves]
    if not moving:
        raise InputError(f"{case}: no paddle moves in it; a wall with a motion is needed.")
    path = Path(f"{case.stem}-paddle.{form}") if out is None else out
    for n, view in enumerate(moving):
        file = path.with_stem(f"{path.stem}-far") if n else path
        signal = _signal(view, rate, ramp_down=ramp_down)
        needs = [_largest(view, signal), *_reference(view)]
        lines = [*needs, *_of_rate(view, rate)]
        if signal.down:
            lines.insert(len(needs), f"ramp-down to rest within {signal.down:.4g} s after the run")
        on_first(MPI.COMM_WORLD, partial(_write, file, view, signal, form, "; ".join(needs)))
        absorbs = getattr(view.wall, "absorb", None) is not None
        lines[0] += " (without what absorbing adds, which only a run knows)" if absorbs else ""
        lines[0] = f"{view.key}: {lines[0]}" if len(moving) > 1 else lines[0]
        wrote = f"wrote {file}: {signal.t.size} rows, {rate:g} a second"
        console().print("\n".join([*lines, wrote]), highlight=False)


class _Signal(NamedTuple):
    """The rows of a file.

    Attributes
    ----------
    t
        Times [s], shape (T,).
    rates
        Position [m], velocity [m/s] and acceleration [m/s²], each of shape (T,), or (T, P) of a paddle in segments.
    down
        How long its ramp-down is [s]; 0 without one.
    """

    t: Array
    rates: list[Array]
    down: float = 0.0

    @property
    def extent(self) -> Extent:
        """Its largest values."""
        return extent(self.rates)


def _signal(end: EndWall, rate: float, *, ramp_down: bool) -> _Signal:
    """Return the rows of a case's paddle; raises ``InputError`` for too many, or a ramp-down beyond its limits."""
    t, limits = _times(end, rate), getattr(end.wall, "limits", None)
    signal = _Signal(t, [*end.rates(t)])
    _, velocity, _ = signal.rates
    if not ramp_down or not np.abs(velocity[-1]).max() > REST * np.abs(velocity).max():
        return signal
    signal = _down(signal, rate)
    for problem in limits.exceeded(signal.extent, end.key, "limits") if limits else ():
        raise InputError(f"{problem} with its ramp-down; --no-ramp-down leaves that out.")
    return signal


def _down(signal: _Signal, rate: float) -> _Signal:
    """Return a signal that continues to rest at X = 0: by a quintic with its last position, velocity and acceleration.

    The quintic's length is that for which its largest values are least, of those that the signal has.
    """
    end = np.array([one[-1] for one in signal.rates])
    largest = np.array([np.abs(one).max() for one in signal.rates])
    result: list[tuple[float, float, list[Array]]] = []
    for length in 2 * np.pi * largest[0] / largest[1] * np.geomspace(0.25, 4.0, 41):
        rows = max(2, int(np.ceil(length * rate)))
        quintic = BPoly.from_derivatives([0.0, rows / rate], [end, 0.0 * end])
        after = np.arange(1, rows + 1) / rate
        rates = [quintic(after), *(quintic.derivative(order)(after) for order in (1, 2))]
        needs = max(float(np.abs(one).max() / most) for one, most in zip(rates, largest, strict=True))
        result.append((needs, rows / rate, rates))
    _, length, rates = min(result, key=lambda one: one[0])
    t = signal.t[-1] + np.arange(1, rates[0].shape[0] + 1) / rate
    joined = [np.concatenate([one, two]) for one, two in zip(signal.rates, rates, strict=True)]
    return _Signal(np.concatenate([signal.t, t]), joined, length)


def _largest(end: EndWall, signal: _Signal) -> str:
    """Return the signal's largest values, each with its limit if there is one."""
    units, limits = ("m", "m/s", "m/s^2"), getattr(end.wall, "limits", None)
    parts, both = [], zip(signal.extent, end.extent, strict=True)
    for name, unit, pair in zip(signal.extent._fields, units, both, strict=True):
        limit = getattr(limits, name, None)
        parts.append(f"{name} {max(pair):.4g} {unit}")
        parts[-1] += "" if limit is None else f" (limit {limit:g} {unit})"
    return ", ".join(parts)


def _heights(end: EndWall) -> tuple[float, float] | None:
    """Return the heights of a flap's position above the bed and above its hinge [m]; None of other paddles."""
    wall = end.wall
    if not isinstance(wall, HingedWall):
        return None
    height = end.tank.depth if wall.stroke_height is None else wall.stroke_height
    return height, height - wall.hinge


def _reference(end: EndWall) -> list[str]:
    """Return the heights of a flap's position as text, in a list; empty of other paddles."""
    heights = _heights(end)
    return [f"position {heights[0]:.4g} m above the bed, {heights[1]:.4g} m above the hinge"] if heights else []


def _of_rate(end: EndWall, rate: float) -> list[str]:
    """Return a warning for a rate that gives the shortest period of the motion few rows.

    Half a period is the time between two reversals more than a tenth of the stroke from each other.
    """
    t = times(min(end.duration, end.motion().duration), 0.01)
    X, v = (one.reshape(t.size, -1)[:, 0] for one in end.rates(t)[:2])
    ends = np.flatnonzero(v[:-1] * v[1:] < 0.0)
    at = t[ends] - v[ends] * (t[ends + 1] - t[ends]) / (v[ends + 1] - v[ends])
    halves = np.diff(at)[np.abs(np.diff(X[ends])) > SMALL * np.ptp(X)]
    if not halves.size or rate * (period := 2 * float(halves.min())) >= ROWS:
        return []
    few = f"--rate {rate:g} gives {rate * period:.3g} rows in the shortest period, {period:.3g} s"
    return [f"warning: {few}; {ROWS} or more are needed, --rate {ROWS / period:.3g}"]


def _times(end: EndWall, rate: float) -> Array:
    """Return times that cover the run [s], shape (T,), as far as the motion is defined."""
    rows = int(np.ceil(end.duration * rate * (1 - 1e-12))) + 1
    if rows > MOST:
        raise InputError(f"--rate {rate:g}: must be at most {MOST / end.duration:.4g}, for {MOST} rows.")
    t = np.arange(rows) / rate
    return np.asarray(t[t <= end.motion().duration])


def _write(path: Path, end: EndWall, signal: _Signal, form: str, needs: str) -> None:
    """Write a signal; raises ``InputError`` where there is a file, or none can be."""
    places, heights = end.wall.places(end.tank), _heights(end)
    rates, names = (signal.rates, paddle_columns(places)) if form == "csv" else (signal.rates[:1], [])
    if heights and form == "csv":
        at = [""] if places is None else [f"@y={y:.6g}" for y in places]
        rates = [*rates, np.arctan(signal.rates[0] / heights[1]), np.full(signal.t.shape, heights[0])]
        names = [*names, *(f"angle{place} [rad]" for place in at), "height of position above bed [m]"]
    table = np.column_stack([signal.t, *rates])
    comma, header = (",", ",".join(names)) if form == "csv" else (" ", f"# t [s], position [m]; {needs}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            np.savetxt(file, table, fmt="%.10g", delimiter=comma, header=header, comments="")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); --out FILE names another.") from None
