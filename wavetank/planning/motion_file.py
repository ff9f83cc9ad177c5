"""``wavetank motion``: what a case asks of its paddles, and the files that wave boards' controllers read."""

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import typer

from wavetank.output.columns import RATES, paddle_columns

if TYPE_CHECKING:
    from wavetank.case import EndWall
    from wavetank.motion.motion import Array, Extent

MOST = 10**7  # rows
ROWS, SMALL = 20, 0.1  # in the shortest period; of the stroke, of waves that do not count
REST = 1e-3  # of the largest speed: a signal that ends so slowly ends at rest


class Format(StrEnum):
    """How the file is written."""

    CSV = "csv"
    TXT = "txt"


def motion(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="file to write, never over another; default: the case's name, -paddle.csv; where both walls move, "
            "-far is added to the name of the far one's"
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="rows a second [Hz]", min=1e-3, max=1e6)] = 100.0,
    form: Annotated[
        Format,
        typer.Option("--format", help="csv: t, position, velocity, acceleration; txt: t and position, no names"),
    ] = Format.CSV,
    ramp_down: Annotated[
        bool, typer.Option("--ramp-down/--no-ramp-down", help="add rows after the run until the paddle is at rest")
    ] = True,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
) -> None:
    """Write the paddle's motion as a wave board reads it.

    A case of type "recorded" reads the file back, as its position, and runs the same. Of a flap the CSV file has its
    angle, too, and the height above the bed of which the position is.
    """
    from mpi4py import MPI

    from wavetank.case.reading import read_case
    from wavetank.console import console
    from wavetank.errors import InputError
    from wavetank.mpi import on_first

    scene = read_case(case, overrides or [])
    moving = [seen for seen in scene.paddles if seen.motion().moves]
    if not moving:
        raise InputError(f"{case}: no paddle moves in it; a wall with a motion is needed.")
    path = Path(f"{case.stem}-paddle.{form}") if out is None else out
    for n, seen in enumerate(moving):
        file = path.with_stem(f"{path.stem}-far") if n else path
        signal = _signal(seen, rate, ramp_down=ramp_down)
        needs = [_told(seen, signal), *_reference(seen)]
        lines = [*needs, *_of_ramp(signal), *_of_rate(seen, rate)]
        on_first(MPI.COMM_WORLD, partial(_write, file, seen, signal, form, "; ".join(needs)))
        absorbs = getattr(seen.wall, "absorb", None) is not None
        lines[0] += " (without what absorbing adds, which only a run knows)" if absorbs else ""
        lines[0] = f"{seen.key}: {lines[0]}" if len(moving) > 1 else lines[0]
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

    t: "Array"
    rates: "list[Array]"
    down: float = 0.0

    @property
    def extent(self) -> "Extent":
        """Its largest values."""
        from wavetank.motion.motion import Extent

        position, velocity, acceleration = self.rates
        largest = float(np.abs(velocity).max()), float(np.abs(acceleration).max())
        return Extent(float(np.ptp(position, axis=0).max()), *largest)


def _signal(scene: "EndWall", rate: float, *, ramp_down: bool) -> _Signal:
    """Return the rows of a case's paddle; raises ``InputError`` for too many, or a ramp-down beyond its limits."""
    from wavetank.errors import InputError
    from wavetank.motion.motion import values

    t, limits = _times(scene, rate), getattr(scene.wall, "limits", None)
    signal = _Signal(t, [values(scene.function(name), t) for name in RATES])
    _, velocity, _ = signal.rates
    if not ramp_down or not np.abs(velocity[-1]).max() > REST * np.abs(velocity).max():
        return signal
    signal = _down(signal, rate)
    for problem in limits.exceeded(signal.extent) if limits else ():
        raise InputError(f"{problem.at('wall', scene.key)} with its ramp-down; --no-ramp-down leaves that out.")
    return signal


def _down(signal: _Signal, rate: float) -> _Signal:
    """Return a signal that goes on to rest at X = 0: by a quintic with its last position, velocity and acceleration.

    The quintic's length is that for which its largest values are least, of those that the signal has.
    """
    from scipy.interpolate import BPoly

    end = np.array([one[-1] for one in signal.rates])
    largest = np.array([np.abs(one).max() for one in signal.rates])
    result: list[tuple[float, float, list[Array]]] = []
    for length in 2 * np.pi * largest[0] / largest[1] * np.geomspace(0.25, 4.0, 41):
        rows = max(2, int(np.ceil(length * rate)))
        quintic = BPoly.from_derivatives([0.0, rows / rate], [end, 0.0 * end])
        times = np.arange(1, rows + 1) / rate
        rates = [quintic(times), *(quintic.derivative(order)(times) for order in (1, 2))]
        needs = max(float(np.abs(one).max() / most) for one, most in zip(rates, largest, strict=True))
        result.append((needs, rows / rate, rates))
    _, length, rates = min(result, key=lambda one: one[0])
    t = signal.t[-1] + np.arange(1, rates[0].shape[0] + 1) / rate
    joined = [np.concatenate([one, two]) for one, two in zip(signal.rates, rates, strict=True)]
    return _Signal(np.concatenate([signal.t, t]), joined, length)


def _told(scene: "EndWall", signal: _Signal) -> str:
    """Return the signal's largest values, each with its limit where there is one."""
    units, limits = ("m", "m/s", "m/s^2"), getattr(scene.wall, "limits", None)
    parts, both = [], zip(signal.extent, scene.extent, strict=True)
    for name, unit, values in zip(signal.extent._fields, units, both, strict=True):
        limit = getattr(limits, name, None)
        parts.append(f"{name} {max(values):.4g} {unit}")
        parts[-1] += "" if limit is None else f" (limit {limit:g} {unit})"
    return ", ".join(parts)


def _heights(scene: "EndWall") -> tuple[float, float] | None:
    """Return how high above the bed and above its hinge a flap's position is [m]; None of other paddles."""
    from wavetank.case.wall import HingedWall

    wall = scene.wall
    if not isinstance(wall, HingedWall):
        return None
    height = scene.tank.depth if wall.stroke_height is None else wall.stroke_height
    return height, height - wall.hinge


def _reference(scene: "EndWall") -> list[str]:
    """Return of what height a flap's position is, as a list of a sentence; empty of other paddles."""
    heights = _heights(scene)
    return [f"position {heights[0]:.4g} m above the bed, {heights[1]:.4g} m above the hinge"] if heights else []


def _of_ramp(signal: _Signal) -> list[str]:
    return [f"ramp-down to rest within {signal.down:.4g} s after the run"] if signal.down else []


def _of_rate(scene: "EndWall", rate: float) -> list[str]:
    """Return a warning for a rate that gives the shortest period of the motion few rows.

    Half a period is the time between two ends of the paddle's way, more than a tenth of its stroke apart.
    """
    from wavetank.motion.motion import times, values

    t = times(min(scene.duration, scene.motion().duration), 0.01)
    X, v = (values(scene.function(name), t).reshape(t.size, -1)[:, 0] for name in ("position", "velocity"))
    ends = np.flatnonzero(v[:-1] * v[1:] < 0.0)
    at = t[ends] - v[ends] * (t[ends + 1] - t[ends]) / (v[ends + 1] - v[ends])
    halves = np.diff(at)[np.abs(np.diff(X[ends])) > SMALL * np.ptp(X)]
    if not halves.size or rate * (period := 2 * float(halves.min())) >= ROWS:
        return []
    few = f"--rate {rate:g} gives {rate * period:.3g} rows in the shortest period, {period:.3g} s"
    return [f"warning: {few}; {ROWS} or more are needed, --rate {ROWS / period:.3g}"]


def _times(scene: "EndWall", rate: float) -> "Array":
    """Return times that cover the run [s], shape (T,), as far as the motion is known."""
    from wavetank.errors import InputError

    rows = int(np.ceil(scene.duration * rate * (1 - 1e-12))) + 1
    if rows > MOST:
        raise InputError(f"--rate {rate:g}: must be at most {MOST / scene.duration:.4g}, for {MOST} rows.")
    t = np.arange(rows) / rate
    return np.asarray(t[t <= scene.motion().duration])


def _write(path: Path, scene: "EndWall", signal: _Signal, form: Format, told: str) -> None:
    """Write a signal; raises ``InputError`` where there is a file, or none can be."""
    from wavetank.errors import InputError

    places, heights = scene.wall.places(scene.tank), _heights(scene)
    rates, names = (signal.rates, paddle_columns(places)) if form is Format.CSV else (signal.rates[:1], [])
    if heights and form is Format.CSV:
        at = [""] if places is None else [f"@y={y:.6g}" for y in places]
        rates = [*rates, np.arctan(signal.rates[0] / heights[1]), np.full(signal.t.shape, heights[0])]
        names = [*names, *(f"angle{place} [rad]" for place in at), "height of position above bed [m]"]
    table = np.column_stack([signal.t, *rates])
    comma, header = (",", ",".join(names)) if form is Format.CSV else (" ", f"# t [s], position [m]; {told}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            np.savetxt(file, table, fmt="%.10g", delimiter=comma, header=header, comments="")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); --out FILE names another.") from None
