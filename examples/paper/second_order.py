"""Second-order generation in the nonlinear tank: bound and free second harmonics along the tank.

Regular waves of a piston or a flap with a given bound second harmonic, and a sponge at the end. The harmonics at all
positions between the near field of the paddle and the sponge are separated by least squares into the bound wave number
2 k and the free ones K and -K (``wavetank/analysis/reflection.py``).
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from mpi4py import MPI
from numpy.typing import NDArray

from examples.paper.report import Report
from examples.paper.watched import Surfaces
from wavetank.analysis.reflection import fit_waves
from wavetank.case import Case
from wavetank.plots.style import BLUE, GREY, VERMILION
from wavetank.simulation.build import build_run
from wavetank.waves.airy import angular_frequency, group_velocity, wave_number
from wavetank.waves.second_order import Strokes, second_order
from wavetank.waves.wavemaker import PISTON, Flap, Wavemaker

GRAVITY = 9.81
DEPTHS = (0.6, 0.8, 1.0, 1.5, 2.0, 3.0)  # kd
SHARES = (0.05, 0.1)  # of the bound second harmonic in the first
NEAR = 2.5  # depths: of the paddle's near field and its mapping's reach
GENERATIONS = ("linear", "second-order")

Array = NDArray[np.float64]


def steepness(kd: float, share: float) -> float:
    """Return k a of a Stokes wave by the ratio of its second to its first harmonic."""
    sigma = np.tanh(kd)
    return float(share * 4.0 * sigma**3 / (3.0 - sigma**2))


class Tank:
    """A tank of depth 1 m for regular waves of kd.

    Parameters
    ----------
    kd
        Of the waves.
    share
        Ratio of the bound second to the first harmonic.
    hinge
        Of the flap that makes them, above the bed [m]; None: a piston does.
    """

    def __init__(self, kd: float, share: float, hinge: float | None = None):
        self.wall: dict[str, Any] = {"type": "piston"} if hinge is None else {"type": "flap", "hinge": hinge}
        self.wavemaker: Wavemaker = PISTON if hinge is None else Flap(hinge)
        self.k, self.a = kd, steepness(kd, share) / kd
        self.omega = float(angular_frequency(kd, 1.0, GRAVITY))
        self.free = float(wave_number(2.0 * self.omega, 1.0, GRAVITY))
        self.period, wave_length = 2.0 * np.pi / self.omega, 2.0 * np.pi / kd
        beat = 2.0 * np.pi / (self.free - 2.0 * kd)
        self.end = NEAR + max(1.2 * beat, 0.75 * wave_length)
        self.sponge = max(1.5 * wave_length, 2.0)
        slowest = float(group_velocity(self.free, 1.0, GRAVITY))
        self.duration = self.end / slowest + 8.0 * self.period

    def case(self, generation: str) -> Case:
        """Return the case with a generation."""
        motion = {"type": "regular", "height": 2.0 * self.a, "period": self.period, "ramp": 3.0 * self.period}
        return Case.model_validate(
            {
                "tank": {"length": self.end + self.sponge, "depth": 1.0},
                "wall": self.wall | {"reach": NEAR, "motion": motion | {"generation": generation}},
                "sponge": {"type": "end", "length": self.sponge},
                "run": {"duration": self.duration},
                "numerics": {
                    "cell_size": min(np.pi / self.free, 0.5),
                    "vertical_order": 10 if self.k > 1.2 else 6,
                    "tolerance": 1e-8,
                },
            }
        )

    def harmonics(self, generation: str) -> "Harmonics":
        """Return the first and second harmonic along the tank, of the last two periods of a run."""
        run, waves = build_run(self.case(generation), MPI.COMM_SELF)
        last = Surfaces(start=self.duration - 2.02 * self.period)
        run.diagnostics.append(last)
        run.execute()
        seen = (waves.plane.x > NEAR) & (waves.plane.x < self.end)
        t, eta = np.array(last.t), np.array(last.eta)[:, seen]
        phases = np.multiply.outer(t, self.omega * np.arange(1, 5))
        columns = np.hstack([np.ones((t.size, 1)), np.cos(phases), np.sin(phases)])
        found = np.linalg.lstsq(columns, eta, rcond=None)[0]
        return Harmonics(self, waves.plane.x[seen], found[1] + 1j * found[5], found[2] + 1j * found[6])

    @property
    def expected_free(self) -> float:
        """The amplitude of the free second harmonic that a sine of the piston makes, by theory [m]."""
        b = np.array([1j * self.a / float(self.wavemaker.transfer(self.k, 1.0))])
        more = second_order(Strokes(np.array([self.omega]), b), self.wavemaker, depth=1.0, gravity=GRAVITY)
        return float(np.abs(more.b[0]) * self.wavemaker.transfer(self.free, 1.0))


class Harmonics(NamedTuple):
    """Complex amplitudes [m] of the first and the second harmonic at places x [m], shape (N,)."""

    tank: Tank
    x: Array
    first: NDArray[Any]
    second: NDArray[Any]

    def fit_waves(self) -> Array:
        """Return amplitudes [m] of the first harmonic, and of the second bound and free."""
        tank = self.tank
        one = fit_waves(self.first, self.x, [tank.k, -tank.k]).amplitudes
        two = fit_waves(self.second, self.x, [2.0 * tank.k, tank.free, -tank.free]).amplitudes
        return np.abs([one[0], two[0], two[1]])


class FreeRow(NamedTuple):
    """The second harmonic, over the first, as measured and by theory."""

    kd: float
    steepness: float
    generation: str
    height_over_target: float
    bound: float
    bound_by_stokes: float
    free: float
    free_by_theory: float
    free_over_bound: float


def row(kd: float, share: float, generation: str, hinge: float | None = None) -> tuple[FreeRow, Harmonics]:
    """Return free and bound second harmonics."""
    tank = Tank(kd, share, hinge)
    found = tank.harmonics(generation)
    first, bound, free = found.fit_waves()
    expected = tank.expected_free / tank.a if generation == "linear" else 0.0
    ratios = first / tank.a, bound / first, share * first / tank.a, free / first, expected, free / bound
    return FreeRow(kd, tank.k * tank.a, generation, *map(float, ratios)), found


def rows() -> Iterator[FreeRow]:
    """Yield all depths and ratios, with both generations."""
    for share in SHARES:
        for kd in DEPTHS:
            for generation in GENERATIONS:
                yield row(kd, share, generation)[0]


def theory(kd: float) -> float:
    """Return the free second harmonic of a sine of the piston over the bound one, by theory."""
    tank = Tank(kd, 0.01)
    return tank.expected_free / (0.01 * tank.a)


def _draw_along(axes: Axes, found: dict[str, Harmonics]) -> None:
    for generation, colour in zip(GENERATIONS, (VERMILION, BLUE), strict=True):
        one = found[generation]
        order = np.argsort(one.x)
        axes.plot(one.x[order], 100 * np.abs(one.second[order]) / one.tank.a, color=colour, label=generation)
    axes.axhline(100 * SHOWN[1], color=GREY, lw=0.8, ls="--", label="bound, by Stokes")
    axes.set(xlabel="x / d [-]", ylabel="second harmonic [% of the first]", ylim=(0, None))
    axes.set_title(f"Along the tank, kd = {SHOWN[0]:g}, ka = {found['linear'].tank.k * found['linear'].tank.a:.3f}")
    axes.legend()


def _draw_free(axes: Axes, table: Sequence[FreeRow]) -> None:
    kd = np.linspace(0.4, 3.2, 40)
    axes.semilogy(kd, [100 * theory(one) for one in kd], color=VERMILION, lw=1, label="linear, by theory")
    for share, mark in zip(SHARES, "os", strict=True):
        for generation, colour in zip(GENERATIONS, (VERMILION, BLUE), strict=True):
            chosen = [one for one in table if one.generation == generation and _near(one, share)]
            x, y = [one.kd for one in chosen], [100 * one.free_over_bound for one in chosen]
            axes.semilogy(x, y, mark, color=colour, ms=5, label=f"{generation}, bound {100 * share:g} %")
    axes.set(xlabel="kd [-]", ylabel="free over bound second harmonic [%]", title="What the paddle makes besides")
    axes.legend(fontsize=8)


def _near(one: FreeRow, share: float) -> bool:
    return bool(np.isclose(one.steepness, steepness(one.kd, share)))


SHOWN = 1.0, 0.05  # kd, share


def write(report: Report) -> None:
    """Write second-order.csv and .png."""
    table = list(rows())
    report.table("second-order", FreeRow._fields, table)
    found = {generation: row(*SHOWN, generation)[1] for generation in GENERATIONS}
    with report.figure("second-order", 11, 4.6) as figure:
        left, right = figure.subplots(1, 2)
        _draw_along(left, found)
        _draw_free(right, table)
