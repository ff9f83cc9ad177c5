"""Reflection of regular waves by a sponge, by its length, the depth and the frequency.

Linear waves of a piston in the frequency domain, with e^(-i omega t) and the operators of the discretisation:

    (G - M (omega² + i omega gamma) / g) psi = -w

has no error in time and no transients. The same in time, linear and nonlinear, with the scheme and its damping factor.
Incident and reflected amplitude are fitted by least squares at all positions between paddle and sponge
(E. P. D. Mansard, E. R. Funke, Proc. 17th Int. Conf. Coastal Eng., 1980).
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI
from numpy.typing import NDArray

from examples.paper.report import Report
from examples.paper.watched import watched
from wavetank.analysis.reflection import reflected
from wavetank.case.tank import BeachBed, EndSponge, SliceTank
from wavetank.fem.plane import Plane
from wavetank.integrators import Damping, Simpson4, damped
from wavetank.integrators.contract import State
from wavetank.motion import Motion, ramped, sinusoid
from wavetank.plots.style import BLUE, GREEN, LIGHT_BLUE, ORANGE, PALE_GREY, VERMILION, entry
from wavetank.tank.dissipation import profile
from wavetank.tank.footprint import Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import LinearPaddle, Paddle, Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.airy import angular_frequency, group_velocity, wave_number
from wavetank.waves.wavemaker import PISTON

DEPTHS = (0.25, 0.5, 1.0, 2.0, 4.0)  # kd
LENGTHS = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0)  # sponge over wave length
SIZES = (1.0, 2.0, 3.0)  # the same, for the band
COLOURS = dict(zip(DEPTHS, (LIGHT_BLUE, BLUE, GREEN, ORANGE, VERMILION), strict=True))
TWO_PER_CENT = entry("2 %", color=PALE_GREY, lw=0.8)
DASHES = dict(zip(SIZES, ("-", "--", ":"), strict=True))
RATIOS = (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)  # frequency over the design's
AHEAD, QUIET = 1.5, 5.0  # wave lengths and depths between paddle and sponge; the depths keep the paddle's near field
STEPS = 40  # a period
SHALLOW = 0.1  # m: the depth at a beach's end

Complex = NDArray[np.complexfloating[Any, Any]]


class Beach:
    """A slice of depth 1 m for waves of kd, with a sponge of some wave lengths at its end, of the default strength.

    Parameters
    ----------
    kd
        k d of the design wave.
    lengths
        Length of the sponge over that of the wave.
    cells
        A wave length.
    least
        Depth at the end of the bed that rises below the sponge [m].
    share
        Strength over the default.
    """

    def __init__(self, kd: float, lengths: float, *, cells: int = 16, least: float = 1.0, share: float = 1.0):
        self.k, self.wave_length = kd, 2 * np.pi / kd
        self.width, self.start = lengths * self.wave_length, AHEAD * self.wave_length + QUIET
        self.length = self.start + self.width
        self.vertical_order = 6 if kd < 3 else 10
        count = int(np.ceil(self.length / min(self.wave_length / cells, 1.0)))
        self.footprint = Slice(self.length, count, comm=MPI.COMM_SELF)
        self.plane = Plane(self.footprint.mesh, 3, self.footprint.chart)
        tank = SliceTank(length=self.length, depth=1.0)
        self.omega = float(angular_frequency(kd, 1.0, tank.gravity))
        strength = EndSponge(length=self.width).strength_for(self.width, tank, paddle=2 * np.pi / self.omega)
        self.gamma = profile(self.plane.x - self.start, width=self.width, strength=share * strength)
        slope = BeachBed(start=self.start, slope=(1.0 - least) / self.width) if least < 1.0 else None
        self.depth = 1.0 if slope is None else slope.build(1.0)

    def linear(self, motion: Motion) -> LinearWaves:
        """Return linear waves of a piston."""
        wall = Wall(LinearPaddle(motion, side=self.footprint.side()))
        return LinearWaves(self.plane, depth=self.depth, wall=wall, vertical_order=self.vertical_order)

    def nonlinear(self, motion: Motion) -> NonlinearWaves:
        """Return nonlinear waves of a piston; its mapping ends before the evaluated range."""
        wall = Wall(Paddle(motion, plane=self.plane, reach=QUIET, side=self.footprint.side()))
        tolerances = Tolerances(stage=1e-7, interior=1e-8)
        return NonlinearWaves(
            self.plane, depth=self.depth, wall=wall, vertical_order=self.vertical_order, tolerances=tolerances
        )

    def reflection(self, values: Complex, omega: float) -> float:
        """Return reflected over incident amplitude of values at the degrees of freedom, of frequency omega."""
        k = float(wave_number(omega, 1.0, 9.81))
        seen = (self.plane.x > QUIET) & (self.plane.x < self.start - 0.2)
        return reflected(values[seen], self.plane.x[seen], k, within=0.03).reflection


class Operators:
    """The dense operators of a beach's linear waves."""

    def __init__(self, beach: Beach):
        waves, units = beach.linear(sinusoid(1.0, 2 * np.pi)), np.eye(beach.plane.owned)
        still, rest = waves.state(0 * beach.plane.x, 0 * beach.plane.x)
        self._beach, self._gravity = beach, waves.gravity
        self._inflow = waves.H_p(still, rest, 0.0)  # the motion's velocity is 1 m/s
        self._G = np.column_stack([waves.H_p(still, unit, 0.0) - self._inflow for unit in units])
        self._M = np.column_stack([waves.mass.apply(unit) for unit in units])

    def reflection(self, ratio: float) -> float:
        """Return the reflection of a wave of ``ratio`` times the frequency that the sponge is made for."""
        omega = ratio * self._beach.omega
        factor = (omega**2 + 1j * omega * self._beach.gamma) / self._gravity
        return self._beach.reflection(np.linalg.solve(self._G - self._M * factor, -self._inflow), omega)


def in_time(beach: Beach, waves: LinearWaves | NonlinearWaves, *, steps: int = STEPS) -> float:
    """Return the reflection in time, of the last two periods of a run of the tank's length there and back, and more."""
    period = 2 * np.pi / beach.omega
    crossing = beach.length / float(group_velocity(beach.k, 1.0, 9.81))
    count, dt = steps * int(np.ceil(2.5 * crossing / period + 6)), period / steps
    scheme = damped(Simpson4(), Damping(beach.gamma))
    harmonic: Complex = np.zeros(beach.plane.owned, dtype=np.complex128)

    def add(state: State, step: int) -> None:
        if step > count - 2 * steps:
            harmonic[:] += waves.elevation(state.q, state.p, step * dt) * np.exp(1j * beach.omega * step * dt)

    watched(waves, scheme, add, start=waves.state(0 * beach.plane.x, 0 * beach.plane.x), dt=dt, steps=count)
    return beach.reflection(harmonic, beach.omega)


def paddle(beach: Beach, steepness: float) -> Motion:
    """Return the piston's motion for waves of ka by linear theory."""
    period = 2 * np.pi / beach.omega
    stroke = steepness / beach.k / float(PISTON.transfer(beach.k, 1.0))
    return ramped(sinusoid(stroke, period), 3 * period)


class LengthRow(NamedTuple):
    """Reflection of the wave that the sponge is made for."""

    kd: float
    sponge_over_wave_length: float
    reflection: float


class BandRow(NamedTuple):
    """Reflection of waves of other frequencies than the sponge is made for."""

    kd: float
    sponge_over_wave_length: float
    frequency_ratio: float
    reflection: float


class BeachRow(NamedTuple):
    """Reflection where the bed rises to a tenth of the depth beneath the sponge, of so much of the default strength."""

    kd: float
    sponge_over_wave_length: float
    strength_over_default: float
    frequency_ratio: float
    reflection: float


class TimeRow(NamedTuple):
    """Reflection in time, of waves of ka; 0 for linear ones."""

    kd: float
    sponge_over_wave_length: float
    steepness: float
    reflection: float


def length_rows() -> Iterator[LengthRow]:
    """Yield all depths and lengths."""
    for kd in DEPTHS:
        for lengths in LENGTHS:
            yield LengthRow(kd, lengths, Operators(Beach(kd, lengths)).reflection(1.0))


def band_rows() -> Iterator[BandRow]:
    """Yield frequencies from half to twice the design's."""
    for kd in DEPTHS:
        for lengths in SIZES:
            operators = Operators(Beach(kd, lengths, cells=24))
            for ratio in RATIOS:
                yield BandRow(kd, lengths, ratio, operators.reflection(ratio))


def beach_rows() -> Iterator[BeachRow]:
    """Yield sponges of two strengths over beaches, for waves of the frequency they are made for and longer ones."""
    for kd in DEPTHS[1:4]:
        for lengths in LENGTHS[:3]:
            for share in (0.5, 1.0):
                operators = Operators(Beach(kd, lengths, least=SHALLOW, share=share))
                for ratio in RATIOS[:4:3]:
                    yield BeachRow(kd, lengths, share, ratio, operators.reflection(ratio))


def time_rows() -> Iterator[TimeRow]:
    """Yield linear waves and nonlinear ones of two steepnesses, with a sponge of one wave length."""
    for kd in (0.5, 1.0, 2.0, 4.0):
        beach = Beach(kd, 1.0, cells=12)
        yield TimeRow(kd, 1.0, 0.0, in_time(beach, beach.linear(paddle(beach, 0.01))))
        for steepness in (0.01, 0.1):
            if steepness < 0.5 * kd**3:  # else the waves are not Stokes', and one frequency is not one wave
                yield TimeRow(kd, 1.0, steepness, in_time(beach, beach.nonlinear(paddle(beach, steepness))))


def _draw_lengths(axes: Axes, lengths: Sequence[LengthRow], times: Sequence[TimeRow]) -> None:
    for kd, colour in COLOURS.items():
        chosen = [(row.sponge_over_wave_length, 100 * row.reflection) for row in lengths if row.kd == kd]
        axes.semilogy(*zip(*chosen, strict=True), "o-", color=colour, ms=4)
    marked = [(row.sponge_over_wave_length, 100 * row.reflection) for row in times if row.steepness > 0.0]
    axes.semilogy(*zip(*marked, strict=True), "kx", ms=6)
    axes.set(xlabel="length of the sponge over that of the wave [-]", title="The wave that the sponge is made for")
    nonlinear = entry("nonlinear, in time, ka = 0.01 and 0.1", color="k", marker="x", ls="")
    axes.legend(handles=[entry("linear, of one frequency", marker="o", ms=4), nonlinear, TWO_PER_CENT])


def _draw_bands(axes: Axes, bands: Sequence[BandRow]) -> None:
    for kd, colour in COLOURS.items():
        for size, look in DASHES.items():
            chosen = [row for row in bands if row.kd == kd and row.sponge_over_wave_length == size]
            axes.semilogy(
                [row.frequency_ratio for row in chosen], [100 * row.reflection for row in chosen], look, color=colour
            )
    axes.set(xlabel="frequency over the design's [-]", title="Waves of other frequencies")
    axes.legend(handles=[*(entry(f"sponge of {size:g} λ", ls=look) for size, look in DASHES.items()), TWO_PER_CENT])


def write(report: Report) -> None:
    """Write sponge-length.csv and .png, sponge-band.csv, sponge-beach.csv and sponge-time.csv."""
    lengths, bands, times = list(length_rows()), list(band_rows()), list(time_rows())
    report.table("sponge-length", LengthRow._fields, lengths)
    report.table("sponge-band", BandRow._fields, bands)
    report.table("sponge-beach", BeachRow._fields, list(beach_rows()))
    report.table("sponge-time", TimeRow._fields, times)
    draw(report, lengths, bands, times)


def draw(report: Report, lengths: Sequence[LengthRow], bands: Sequence[BandRow], times: Sequence[TimeRow]) -> None:
    """Draw the reflection against the sponge's length and the waves' frequency, in the same colours."""
    with report.figure("sponge-length", 11, 4.9) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        _draw_lengths(left, lengths, times)
        _draw_bands(right, bands)
        for axes in (left, right):
            axes.axhline(2.0, color=PALE_GREY, lw=0.8)
        left.set(ylabel="reflected over incident amplitude [%]", ylim=(1e-3, 60))
        handles = [entry(f"kd = {kd:g}", color=colour, lw=3) for kd, colour in COLOURS.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
