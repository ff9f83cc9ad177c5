"""The initial state."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wavetank import data
from wavetank import motion as motions
from wavetank.base.case_model import CaseModel, Check, FilePath, FormulaModel, FormulaText, about, one_of
from wavetank.base.columns import check_ascending, read_columns
from wavetank.base.errors import InputError
from wavetank.base.formula import Array
from wavetank.base.quantities import Coordinate, Count, Fraction, Frequency, Height, metres
from wavetank.case.paddle import GaussianSpectrum, JonswapSpectrum, PiersonMoskowitzSpectrum, TmaSpectrum
from wavetank.case.tank import AnyTank, BasinTank, Context, RingTank, SliceTank, inside
from wavetank.mesh import Rectangle
from wavetank.waves.airy import angular_frequency, group_velocity
from wavetank.waves.conformal import SteadyWave
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.solitary_wave import HIGHEST_SOLITARY, solitary_wave
from wavetank.waves.spectra import uniform
from wavetank.waves.stream_function import maximum_height, stream_function_wave

# ---------------------------------------------------------------- a surface from a file
LARGEST_GAP_RATIO = 2.0  # largest gap between last and first point around a ring, over that of other points
MIN_POINTS = 4  # least number of points: of a cubic spline, or of triangles


class FileSurface(CaseModel):
    """Elevation and potential from a file: columns x, eta and psi of a slice or ring, x, y, eta and psi of a basin.

    The water is at rest without psi. Points are interpolated by a cubic spline along a slice, by a periodic one around
    a ring, and in basins by a surface on triangles with continuous slopes.
    """

    type: Literal["file"] = "file"
    file: FilePath = Field(
        description="text file of columns: x, eta [m] and, if not at rest, psi [m^2/s]; in a basin x, y, eta, psi"
    )

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at x, y [m], shape (N,) each.

        Raises ``InputError`` for a file that cannot be read, or that does not cover the tank.
        """
        path = data.resolve(self.file)
        axes = ["x", "y"] if isinstance(tank, BasinTank) else ["x"]
        allowed = f"allowed are finite numbers: {', '.join(axes)}, eta and, where the water moves, psi"
        table = read_columns(path, allowed=allowed)
        rows, columns = table.values.shape
        if rows < MIN_POINTS or columns not in (len(axes) + 1, len(axes) + 2):
            raise InputError(
                f"{path}: {rows} rows of {columns} columns received; {allowed}, {MIN_POINTS} rows or more."
            )
        at, values = np.split(table.values, [len(axes)], axis=1)
        if isinstance(tank, BasinTank):
            surface = _over(path, at, values)(np.column_stack([x, y]))
        else:
            check_ascending(path, table.lines, at[:, 0], what=("x =", "places"))
            around = tank.length if isinstance(tank, RingTank) else None
            surface = _along(path, at[:, 0], values, around=around)(x)
        if np.isnan(surface).any():
            where = int(np.isnan(surface).any(axis=1).argmax())
            place = ", ".join(f"{axis} = {one[where]:.6g} m" for axis, one in zip(axes, (x, y), strict=False))
            raise InputError(f"{path}: does not reach {place}, where there is water.")
        return surface[:, 0], surface[:, 1] if values.shape[1] > 1 else np.zeros_like(x)


def _along(path: Path, at: motions.Array, values: motions.Array, *, around: float | None) -> Any:
    """Return the spline of values along x: nan beyond its ends, or periodic around a ring of a length [m]."""
    from scipy.interpolate import CubicSpline

    if around is None:
        return CubicSpline(at, values, extrapolate=False)
    gap, widest = around - np.ptp(at), float(np.diff(at).max())
    received = f"{path}: x from {at[0]:g} to {at[-1]:g} m received"
    if gap < -around * 1e-9:
        raise InputError(f"{received}; a ring of {around:g} m is shorter.")
    if gap > LARGEST_GAP_RATIO * widest:
        raise InputError(f"{received}; {gap:.3g} m of a ring of {around:g} m are left out: points must go all round.")
    if gap > around * 1e-9:
        at, values = np.append(at, at[0] + around), np.vstack([values, values[:1]])
    values = np.vstack([values[:-1], values[:1]])  # which is the last
    return CubicSpline(at, values, bc_type="periodic", extrapolate="periodic")


def _over(path: Path, at: motions.Array, values: motions.Array) -> Any:
    """Return the interpolation of values over (x, y) on triangles; nan outside."""
    from scipy.interpolate import CloughTocher2DInterpolator
    from scipy.spatial import QhullError

    try:
        return CloughTocher2DInterpolator(at, values)
    except QhullError:
        raise InputError(f"{path}: its points stand on one line; a basin's must reach around it.") from None


# ---------------------------------------------------------------- a surface by formulae
class FormulaSurface(FormulaModel):
    """eta(x, y) and psi(x, y) by formulae; at rest without psi."""

    type: Literal["formula"] = "formula"
    eta: FormulaText = Field(description="elevation eta(x, y) [m]")
    psi: FormulaText = Field(default="0", description="surface potential psi(x, y) [m^2/s]")

    def surface(self, tank: AnyTank, x: Array, y: Array) -> tuple[Array, Array]:
        """Return eta [m] and psi [m²/s] at x, y [m], shape (N,) each; raises ``InputError`` if not finite."""
        return self.formula(self.eta)(x, y), self.formula(self.psi)(x, y)


# ---------------------------------------------------------------- a state of another run
class RunState(CaseModel):
    """The surface of another run of the same tank, from its checkpoint, also on other cells.

    Time begins at 0. Default numerics are those of the other run.
    """

    type: Literal["run"] = "run"
    directory: FilePath = Field(description="directory of that run")
    t: float | None = Field(
        default=None, ge=0.0, le=1e9, description="time of one of its two checkpoints [s]; default: the last one"
    )


# ---------------------------------------------------------------- linear waves of a spectrum
Shape = Annotated[
    JonswapSpectrum | PiersonMoskowitzSpectrum | TmaSpectrum | GaussianSpectrum,
    Field(discriminator="type", description="shape S(f)"),
]
HIGHEST_OF_PEAK = 3.0
MAX_WAVES = 10_000  # largest number of waves
MIN_WAVES = 1.5  # effective number of waves, (sum S df)² / sum (S df)²
REFLECTED = "needs a ring (tank.type): walls reflect such waves"
STEEPEST = 0.14  # height over length of the highest waves, times tanh k d (Miche)


class SpectralSurface(CaseModel):
    """Linear waves of a spectrum."""

    spectrum: Shape
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 3 fp")

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m], and psi [m²/s] of linear waves at still water, at x, y [m], shape (N,) each."""
        waves = self.waves(tank)
        return waves.elevation(x), waves.potential(x)

    def waves(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves."""
        raise NotImplementedError

    def _along(self, tank: AnyTank) -> tuple[motions.Array, motions.Array]:
        """Return wave numbers of modes that fit the tank [rad/m], and S(f) df of each up to a factor, shape (N,)."""
        highest, step = self._highest(tank), 2 * np.pi / tank.length
        k = step * np.arange(1, MAX_WAVES + 1, dtype=np.float64)
        k = k[angular_frequency(k, tank.depth, tank.gravity) <= highest]
        frequencies = np.asarray(angular_frequency(k, tank.depth, tank.gravity) / (2 * np.pi), dtype=np.float64)
        speeds = group_velocity(k, tank.depth, tank.gravity)
        return k, np.asarray(self.spectrum.build(tank).density(frequencies) * speeds)

    def _highest(self, tank: AnyTank) -> float:
        """Return the last angular frequency [rad/s], default resolved."""
        peak = self.spectrum.build(tank).peak_frequency
        return 2 * np.pi * (HIGHEST_OF_PEAK * peak if self.highest_frequency is None else self.highest_frequency)

    def _waves(self, tank: AnyTank, k: motions.Array, amplitudes: NDArray[np.complex128]) -> PlaneWaves:
        omega = np.asarray(angular_frequency(k, tank.depth, tank.gravity))
        return PlaneWaves(amplitudes=amplitudes, k_x=k, k_y=0 * k, omega=omega, depth=tank.depth, gravity=tank.gravity)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank is a slice or ring, which several but not too many modes of the spectrum fit."""
        tank = end.tank
        along = "needs a slice or ring (tank.type): waves go along it"
        yield "type", not isinstance(tank, BasinTank), along
        ends = 2 * np.pi / tank.length * np.array([1, MAX_WAVES])
        first, last = angular_frequency(ends, tank.depth, tank.gravity) / (2 * np.pi)
        allowed = f"must be from {first:.4g} Hz, of a wave as long as the tank, to {last:.4g} Hz"
        yield "highest_frequency", bool(first < self._highest(tank) / (2 * np.pi) < last), allowed, True
        k, variances = self._along(tank)
        yield "spectrum", variances.sum() > 0.0, "must have waves, whole ones as long as the tank"
        hertz = angular_frequency(k[variances.argmax()], tank.depth, tank.gravity) / (2 * np.pi)
        allowed = f"must have more than one wave that fits: of whole ones along {metres(tank.length)} m nearly all is "
        allowed += f"in that of {hertz:.4g} Hz; the tank may be longer"
        yield "spectrum", variances.sum() ** 2 >= MIN_WAVES * np.square(variances).sum(), allowed


class IrregularSurface(SpectralSurface):
    """An irregular sea along the complete tank, of linear waves to +x; a seed gives the same sea on all machines."""

    type: Literal["irregular"] = "irregular"
    significant_height: Height = Field(description="significant wave height Hm0 = 4 m0^(1/2) [m]")
    seed: int = Field(default=1, ge=0, le=2**53, description="seed of the random phases")

    def waves(self, tank: AnyTank) -> PlaneWaves:
        """Return the sea: its variance is (Hm0 / 4)²."""
        k, variances = self._along(tank)
        amplitudes = self.significant_height / 4.0 * np.sqrt(2.0 * variances / variances.sum())
        return self._waves(tank, k, amplitudes * np.exp(2j * np.pi * uniform(self.seed, k.size)))

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that no walls reflect the waves, the conditions of a spectrum, and a limit of the height."""
        yield "type", isinstance(end.tank, RingTank), REFLECTED
        yield from super().checks(end)
        highest = min(STEEPEST * end.tank.length, end.tank.depth)
        allowed = f"must be at most {highest:.4g} m, of waves in that depth and tank"
        yield "significant_height", self.significant_height <= highest, allowed


class FocusedSurface(SpectralSurface):
    """A focused group to +x with its crest, or trough, at t = 0: the most probable extreme of a sea (NewWave)."""

    type: Literal["focused"] = "focused"
    linear_crest: float = Field(
        ge=-1e6, le=1e6, description="elevation at the focus by linear theory [m]; negative: a trough"
    )
    x: Coordinate = Field(description="x of the focus [m]")

    def waves(self, tank: AnyTank) -> PlaneWaves:
        """Return the group: amplitudes are proportional to S(f) df."""
        k, variances = self._along(tank)
        return self._waves(tank, k, self.linear_crest * variances / variances.sum() * np.exp(-1j * k * self.x))

    def at_ends(self, tank: SliceTank) -> motions.Array:
        """Return the envelope at both ends of a slice over the crest, shape (2,)."""
        k, variances = self._along(tank)
        phases = np.exp(1j * np.multiply.outer([-self.x, tank.length - self.x], k))
        return np.asarray(np.abs(phases @ variances) / variances.sum())

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of a spectrum, a focus inside the tank, and a trough above the bed."""
        yield from super().checks(end)
        yield from inside(end.tank, (self.x, 0.0), "x", "x")
        allowed = f"must be less than the still-water depth, {end.tank.depth:g} m, either way"
        yield "linear_crest", abs(self.linear_crest) < end.tank.depth, allowed


# ---------------------------------------------------------------- still water and steady or standing waves
BREAKING = 0.109 * 2 * np.pi  # k a / tanh(k d) of the highest standing wave, H / L = 0.218 tanh(k d) (Danel, 1952)


def _box(tank: AnyTank) -> tuple[float, float, float, float]:
    """Return (x_min, y_min, x_max, y_max) [m]; the width of a slice is 1."""
    if isinstance(tank, BasinTank) and tank.layout.box is not None:
        return tank.layout.box
    return 0.0, 0.0, tank.length, 1.0


class StillWater(CaseModel):
    """eta = 0, psi = 0."""

    type: Literal["still-water"] = "still-water"

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x, y [m], each of shape (N,)."""
        return np.zeros_like(x), np.zeros_like(x)


class TheoreticalWave(CaseModel):
    """A wave of a theory at t = 0."""

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return the wave."""
        raise NotImplementedError

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x, y [m], each of shape (N,); raises as ``wave`` does."""
        return self.wave(tank).surface(x, y=y)


class StandingWave(CaseModel):
    """eta = a cos(m pi x / length), psi = 0; in a rectangular basin times cos(n pi y / width)."""

    type: Literal["standing-wave"] = "standing-wave"
    wave_amplitude: Height = Field(description="amplitude a of the elevation [m]")
    mode: Count = Field(default=1, description="number m of half waves along the tank")
    mode_across: int = Field(default=0, ge=0, le=10**9, description="number n of half waves across a basin")

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at x, y [m], shape (N,) each."""
        x_min, y_min, x_max, y_max = _box(tank)
        along, across = (x - x_min) / (x_max - x_min), (y - y_min) / (y_max - y_min)
        eta = self.wave_amplitude * np.cos(np.pi * self.mode * along) * np.cos(np.pi * self.mode_across * across)
        return eta, np.zeros_like(eta)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank has the mode, and that its wave neither breaks nor dries the bed."""
        tank, depth = end.tank, end.tank.depth
        rectangular = not isinstance(tank, BasinTank) or isinstance(tank.layout, Rectangle)
        yield "type", rectangular, "needs a rectangle (tank.layout.type)"
        wide = isinstance(tank, BasinTank) or not self.mode_across
        yield "mode_across", wide, f"must be 0: a {tank.type} has no width"
        even = not isinstance(tank, RingTank) or self.mode % 2 == 0
        yield "mode", even, "must be even: whole waves, two halves each, fit a ring"
        x_min, y_min, x_max, y_max = _box(tank)
        k = float(np.hypot(self.mode / (x_max - x_min), self.mode_across / (y_max - y_min))) * np.pi
        highest = BREAKING * float(np.tanh(k * depth)) / k
        allowed = f"must be at most {highest:.4g} m, where standing waves of this length break in {depth:g} m of water"
        yield "wave_amplitude", end.physics == "linear" or self.wave_amplitude <= highest, allowed
        yield "wave_amplitude", self.wave_amplitude < depth, f"must be below the still-water depth, {depth:g} m"


class StreamFunctionWave(TheoreticalWave):
    """Waves of permanent form in a ring, to +x, with a crest at x = 0: exact, without mean Eulerian current."""

    type: Literal["stream-function"] = "stream-function"
    height: Height | None = Field(default=None, description="height, crest above trough [m]; default: by steepness")
    steepness: Fraction | None = Field(
        default=None, description="height over that of the highest wave [-]; default: by height"
    )
    waves: Count = Field(default=1, description="number of waves around the ring")

    _one_height = one_of("height", "steepness")

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return one of the waves; raises ``CaseError`` if there is none."""
        length = tank.length / self.waves
        height = self.height or (self.steepness or 0.0) * maximum_height(length, tank.depth)
        with about("initial"):
            return stream_function_wave(height, length, depth=tank.depth, gravity=tank.gravity)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank is a ring, and that a wave of this height exists."""
        yield "type", isinstance(end.tank, RingTank), REFLECTED
        highest = maximum_height(end.tank.length / self.waves, end.tank.depth)
        exists = self.height is None or self.height < highest
        yield "height", exists, f"must be below that of the highest wave of this length, {highest:.4g} m"


class SolitaryWave(TheoreticalWave):
    """The solitary wave, to +x; exact if both ends of the tank are far from it."""

    type: Literal["solitary-wave"] = "solitary-wave"
    height: Height = Field(description="height of the crest above still water [m]")
    x: Coordinate = Field(description="x of the crest [m]")

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return the wave with its crest at its position."""
        return replace(solitary_wave(self.height, depth=tank.depth, gravity=tank.gravity), crest=self.x)

    def at_ends(self, tank: SliceTank) -> motions.Array:
        """Return the elevation at both ends of a slice over the height, shape (2,)."""
        return np.asarray(self.wave(tank).elevation(np.array([0.0, tank.length])) / self.height, dtype=np.float64)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank has ends, with the crest between them, and that the wave exists."""
        yield "type", not isinstance(end.tank, RingTank), "needs a slice (tank.type): its potential is not periodic"
        between = isinstance(end.tank, BasinTank) or 0 <= self.x <= end.tank.length
        yield "x", between, f"must be inside the tank, 0 to {metres(end.tank.length)} m"
        highest = HIGHEST_SOLITARY * end.tank.depth
        yield "height", self.height <= highest, f"must be at most {HIGHEST_SOLITARY:g} depths, {highest:.4g} m"


Initial = Annotated[
    StillWater
    | StandingWave
    | StreamFunctionWave
    | SolitaryWave
    | IrregularSurface
    | FocusedSurface
    | FormulaSurface
    | FileSurface
    | RunState,
    Field(discriminator="type", description="initial state"),
]
