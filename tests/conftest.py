"""Tanks and runs that several tests need."""

import gc
import io
import signal
from collections.abc import Callable, Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import hypothesis
import numpy as np
import pytest
from mpi4py import MPI
from ranks import CHECKOUT, Crews


def pytest_configure(config: pytest.Config) -> None:
    """Wait for a busy machine; end as by Ctrl-C, with all that has begun, where the suite is told to end."""
    pytest.register_assert_rewrite("runs")
    slow = [hypothesis.HealthCheck.too_slow]
    hypothesis.settings.register_profile("patient", deadline=None, suppress_health_check=slow)
    hypothesis.settings.load_profile("patient")
    signal.signal(signal.SIGTERM, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Leave what is imported and collected out of all garbage collections."""
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def few_pixels() -> None:
    """Draw figures with a quarter of the pixels."""
    from wavetank.plots.style import STYLE

    STYLE["figure.dpi"] *= 0.5


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Return the figures that would have been saved."""
    from matplotlib.figure import Figure

    figures: list[object] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: figures.append(figure))
    return figures


@pytest.fixture
def trusted() -> Iterator[None]:
    """Trust the Python files that cases name."""
    from wavetank.base.python_file import trusting

    with trusting():
        yield


@pytest.fixture
def make_tank() -> Callable[..., object]:
    """Return a function that makes nonlinear waves in a slice, or in another footprint."""
    from wavetank.fem.plane import Plane
    from wavetank.tank.footprint import Slice
    from wavetank.tank.walls import BothEnds, Paddle, Polynomial, Wall
    from wavetank.tank.waves import NonlinearWaves, Tolerances
    from wavetank.waves.wavemaker import Flap

    def make(
        *,
        length,
        cells,
        order=3,
        n=8,
        depth=1.0,
        motion=None,
        reach=None,
        hinge=None,
        far=None,
        tolerance=1e-12,
        footprint=Slice,
        comm=MPI.COMM_WORLD,
    ):
        footprint = footprint(length, cells, comm=comm)
        plane = Plane(footprint.mesh, order, footprint.chart)
        wall, shape = Wall(), {}
        if motion is not None:
            reach = min(length, 10 * depth) if reach is None else reach
            if hinge is not None:
                f, kinks = Flap(hinge).mode_shape, Flap(hinge).kinks(depth)
                shape = {"shape": Polynomial.fit(lambda z: f(z, depth), depth, plane.mesh, kinks=kinks)}
            paddle = Paddle(motion, plane=plane, reach=reach, side=footprint.side(), **shape)
            wall = Wall(paddle)
        if far is not None:
            wall = BothEnds(paddle, Paddle(far, plane=plane, reach=reach, side=footprint.side("far wall")))
        tolerances = Tolerances(stage=tolerance, interior=0.1 * tolerance)
        return NonlinearWaves(plane, depth=depth, wall=wall, vertical_order=n, tolerances=tolerances)

    return make


class Said(NamedTuple):
    """How a command has ended: its exit code, and what it has printed."""

    returncode: int
    stdout: str
    stderr: str


def commanded(*arguments: str) -> Said:
    """Run the command line in this process, in the checkout."""
    from wavetank.cli import main

    out, err = io.StringIO(), io.StringIO()
    with chdir(CHECKOUT), redirect_stdout(out), redirect_stderr(err):
        code = main(list(arguments))
    return Said(code, out.getvalue(), err.getvalue())


@pytest.fixture
def wavetank(on_ranks) -> Callable[..., Said]:
    """Return a function that runs the command line, optionally on several ranks, of which all print together."""

    def run(*arguments: str, ranks: int = 1) -> Said:
        if ranks == 1:
            return commanded(*arguments)
        codes, out, err = zip(*on_ranks(commanded, *arguments, ranks=ranks), strict=True)
        assert len(set(codes)) == 1, (codes, err)
        return Said(codes[0], "".join(out), "".join(err))

    return run


@pytest.fixture(scope="session")
def on_ranks() -> Iterator[Callable[..., list]]:
    """Return a function that calls another, of a module, on some ranks, and returns what each has returned."""
    crews = Crews()
    yield crews.call
    crews.end()


@pytest.fixture
def recorded_on_ranks(on_ranks, tmp_path) -> Callable[..., tuple]:
    """Return a function that records a case with some changes on one rank and on three: both run directories."""
    from wavetank.output.directory import RunDirectory

    def run(case: str | Path, *changes: str) -> tuple[RunDirectory, RunDirectory]:
        alone, together = tmp_path / "1", tmp_path / "3"
        recorded(case, changes, alone)
        on_ranks(recorded, case, changes, together)
        return RunDirectory(alone), RunDirectory(together)

    return run


def recorded(case: str | Path, changes: tuple[str, ...], out: Path) -> None:
    """Record a case with some changes in a run directory; collective."""
    from rich.console import Console

    from wavetank.case.reading import read_case
    from wavetank.recording import record_run

    scene = read_case(CHECKOUT / case, list(changes))
    record_run(scene, out, comm=MPI.COMM_WORLD, console=Console(file=io.StringIO()))


def needs_marin() -> None:
    """Skip a test that reads MARIN's data, where they are not."""
    needs_data("marin-202002", "PistonVelocity.dat")


def needs_data(name: str, file: str) -> None:
    """Skip a test that reads a file of a known data set, where it is not."""
    from wavetank import data
    from wavetank.base.errors import InputError

    try:
        data.find(name, file)
    except InputError:
        pytest.skip(f"{name}/{file} is not on this machine; wavetank data fetch {name} brings it")


def fitted_slope(sizes, errors) -> float:
    """Return the slope of log(error) against log(size)."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
