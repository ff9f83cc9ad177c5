"""Breaking in basins: the criteria of slices in the direction of propagation.

Oracles: exact steep waves at any angle; the same surface along a slice.
"""

import csv

import numpy as np
import pytest
from mpi4py import MPI
from rich.console import Console
from test_basin import basin

from wavetank.base.errors import RunError
from wavetank.case import Case
from wavetank.integrators.contract import Point
from wavetank.output.directory import RunDirectory
from wavetank.recording import record_run
from wavetank.simulation.build import build_run
from wavetank.tank.breaking import BasinBreakingWatch, BreakingDissipation
from wavetank.tank.crests import SteepCrest
from wavetank.waves.stream_function import maximum_height, stream_function_wave

LENGTH = 1.5  # of the exact wave [m]
TIME = 0.01  # between two searches [s]


def exact_waves(angle, *, steepness=0.85, kind="quadrilaterals"):
    """Return a watch, the exact wave's states at both searches in a basin, and the wave."""
    waves = basin(4.0, 2.0, [40, 20], kind=kind)
    wave = stream_function_wave(steepness * maximum_height(LENGTH, 0.5), LENGTH, depth=0.5)
    along = waves.plane.places @ [np.cos(angle), np.sin(angle)]

    def at(t):
        place = along - 0.6 - wave.speed * t
        return Point(*waves.state(*wave.surface((place + LENGTH / 2) % LENGTH - LENGTH / 2)))

    return BasinBreakingWatch(waves, waves.surface), (at(0.0), at(TIME)), wave


@pytest.mark.parametrize(("angle", "kind"), [(0.0, "quadrilaterals"), (0.4, "triangles"), (2.5, "quadrilaterals")])
def test_crests_of_an_oblique_wave_have_its_speed_and_its_waters(angle, kind):
    """Oracle: speed c and crest velocity u of the exact wave, 85 % as high as the highest, in any direction."""
    watch, states, wave = exact_waves(angle, kind=kind)
    for state, t in zip(states, (0.0, TIME), strict=True):
        watch.search(state, t)
    _, (behind, ahead) = wave.surface(np.array([-1e-4, 1e-4]))
    assert watch.crests
    for crest in watch.crests:
        phase = (crest.x * np.cos(angle) + crest.y * np.sin(angle) - 0.6 - wave.speed * TIME) / LENGTH
        assert phase == pytest.approx(round(phase), abs=0.04)
        assert crest.speed == pytest.approx(wave.speed, rel=0.04)
        assert crest.velocity == pytest.approx((ahead - behind) / 2e-4, rel=0.05)
    if angle == 0.0:  # the third crest is within a depth of the wall at x = 4 m
        assert {round(crest.x, 1) for crest in watch.crests} == {0.6, 2.1}
    apart = [np.hypot(a.x - b.x, a.y - b.y) for n, a in enumerate(watch.crests) for b in watch.crests[:n]]
    assert min(apart, default=1.0) >= 0.07  # a cell: each crest once


def test_sections_of_one_crest_dissipate_as_one_section():
    """A long crest is cut by several sections near each other; of each point the largest viscosity acts."""
    waves = basin(4.0, 2.0, [10, 5])
    crest = SteepCrest(
        x=2.0, height=0.15, velocity=1.4, current=0.0, speed=1.5, front=0.5, coherence=1.0, outrun=0.0, y=1.0
    )
    breaking = BreakingDissipation(waves, BasinBreakingWatch(waves, waves.surface), dt=0.01)
    x = waves.plane.places[:, 0]
    pair = np.array([waves.state(0.01 * np.cos(np.pi * x), 0.03 * np.sin(np.pi * x))])
    breaking.place([crest])
    once = breaking.passed(pair)
    breaking.place([crest, crest._replace(height=0.1)])
    assert np.abs(once - pair).max() > 1e-3 * np.abs(pair).max()
    assert breaking.passed(pair) == pytest.approx(once, rel=1e-12)


def packet(tank, *, amplitude, on_breaking="stop", duration=0.6):
    """Return a case of a long-crested packet of waves of 1.5 m that travels along x, its middle at x = 3 m."""
    where = {"k": "2*pi/1.5", "a": str(amplitude), "s": "x-3", "env": "exp(-(s/1.5)**2)"}
    start = {"type": "formula", "eta": "a*env*cos(k*s)", "psi": "a*env*sqrt(9.81/k)*sin(k*s)", "where": where}
    numerics = {"cell_size": 0.1, "order": 3, "vertical_order": 4, "dt": 0.01}
    run = {"duration": duration, "on_breaking": on_breaking}
    return Case.model_validate({"tank": {"depth": 0.7} | tank, "initial": start, "run": run, "numerics": numerics})


SLICE = {"type": "slice", "length": 9.0}
BASIN = {"type": "basin", "layout": {"type": "rectangle", "length": 9.0, "width": 0.2}}  # two cells across


def stopped(scene):
    """Return when a run breaks down [s], and the sentence; the end and an empty one of a run that finishes."""
    run, _ = build_run(scene, MPI.COMM_SELF)
    try:
        run.execute()
    except RunError as error:
        return run.t, str(error)
    return run.t, ""


def test_a_breaking_wave_of_a_slice_stops_a_basin_at_the_same_time_and_place():
    """Oracle: the slice. The wave is long-crested."""
    (t, along), (basin_t, across) = (stopped(packet(tank, amplitude=0.13)) for tank in (SLICE, BASIN))
    assert t < 0.4 and basin_t == pytest.approx(t, abs=0.011)
    said = along.partition(": a wave breaks")[0]
    assert across.startswith(said + ", y = ") and ": a wave breaks: the water outruns the crest" in across


def test_a_steep_sound_wave_finishes_in_a_basin_without_alarm(tmp_path):
    """Its slopes pass the threshold of the front, so that crests are judged."""
    scene = packet(BASIN | {"layout": BASIN["layout"] | {"length": 6.0}}, amplitude=0.085, duration=0.3)
    run, waves = build_run(scene, MPI.COMM_SELF)
    run.execute()
    watch = run.filters[0].watch
    assert waves.surface.largest_slope > 0.3 and watch.alarms == () and watch.crests


@pytest.mark.slow
def test_dissipation_takes_as_much_of_a_long_crest_in_a_basin_as_in_a_slice(tmp_path):
    """Oracle: the slice. The alarms begin together, and their table has y."""
    figures = []
    for name, tank in (("slice", SLICE), ("basin", BASIN)):
        out = tmp_path / name
        record_run(
            packet(tank, amplitude=0.13, on_breaking="dissipate"), out, comm=MPI.COMM_SELF, console=Console(quiet=True)
        )
        figures.append(RunDirectory(out).manifest["breaking"])
    with (tmp_path / "basin" / "breaking.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert 0.0 < float(rows[0]["y [m]"]) < 0.2
    along, across = figures
    for key in ("t", "x"):
        assert across["alarms"][0][key] == pytest.approx(along["alarms"][0][key], rel=0.05)
    assert across["part_taken"] == pytest.approx(along["part_taken"], rel=0.1) and along["part_taken"] > 0.1


ANGLE = np.pi / 6
WHERE = {  # distances along and across the direction of propagation from (3, 2.5) m
    "k": "2*pi/1.5",
    "a": "0.13",
    "s": f"(x-3)*cos({ANGLE})+(y-2.5)*sin({ANGLE})",
    "n": f"(y-2.5)*cos({ANGLE})-(x-3)*sin({ANGLE})",
    "env": "exp(-(s/1.5)**2-(n/0.9)**6)",
}


@pytest.mark.slow
def test_a_breaking_packet_of_finite_width_at_an_angle_stops_a_basin():
    """It is as steep as the one that stops a slice after 0.33 s; its sides spread, so that it stops at 0.55 s."""
    layout = {"type": "rectangle", "length": 7.0, "width": 5.0}
    scene = packet({"type": "basin", "layout": layout}, amplitude=0.13)
    t, said = stopped(scene.model_copy(update={"initial": scene.initial.model_copy(update={"where": WHERE})}))
    assert 0.3 < t < 0.6 and ": a wave breaks: the water outruns the crest" in said
