"""Pictures of a run: they exist, say what they show with units, and interpolate a known group to known accuracy."""

import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.layout_engine import ConstrainedLayoutEngine
from pictures import faults
from records import gauge, gauges, surface, write_run
from scipy.optimize import brentq
from xarray import Dataset

from wavetank.analysis.still_water import closed
from wavetank.base.errors import InputError
from wavetank.plots import figures
from wavetank.plots.figures import draw_run, energy_figure, gauges_figure, gauges_overview, surface_figure
from wavetank.plots.style import STYLE, picture

ENERGY = (
    "t [s]",
    *(f"{name} [m^4/s^2]" for name in ("kinetic", "potential", "total", "paddle_work", "balance")),
    "mass [m^2]",
)
FOCUS_X, FOCUS_TIME, AMPLITUDE = 10.0, 20.0, 0.1
T = np.linspace(0.0, 24.0, 241)
FREQUENCIES = 2 * np.pi * np.linspace(0.4, 1.3, 40)
WAVE_NUMBERS = np.array([brentq(lambda k, w=w: 9.81 * k * np.tanh(k) - w**2, 1e-6, 100) for w in FREQUENCIES])
WEIGHTS = np.exp(-(((FREQUENCIES - 4.1) / 1.5) ** 2))


def elevation(x, t):
    """Return a group that focuses by linear theory in 1 m of water, of crest 0.1 m."""
    phase = WAVE_NUMBERS * (np.asarray(x)[..., None] - FOCUS_X) - FREQUENCIES * (np.asarray(t)[..., None] - FOCUS_TIME)
    return AMPLITUDE * np.cos(phase) @ WEIGHTS / WEIGHTS.sum()


@cache
def group():
    """Return snapshots of that group, on a mesh that a paddle moves."""
    mesh = np.linspace(0.0, 24.0, 361)
    paddle = 0.05 * np.sin(4.0 * T) * np.exp(-(((T - 12.0) / 4.0) ** 2))
    x = mesh + paddle[:, None] * np.clip(1.0 - mesh / 10.0, 0.0, 1.0)
    eta = elevation(x, T[:, None])
    return surface(T, x, eta)


def record(x, eta=None, source="computed", *, t=T, name=None, y=0.0):
    """Return the record of a gauge at x [m], by default of the group."""
    return gauge(name or f"{x:g}", x, t, elevation(x, t) if eta is None else eta, source, y)


@pytest.fixture
def run(tmp_path):
    """Return a run directory with the group in it."""
    two = gauges(record(4.0, name="1"), record(10.0, name="2"))
    energy = np.column_stack([T, 0.1 * T, 0.2 * T, 0.3 * T, 0.3 * T, 1e-6 * np.sin(T), 24.0 + 0 * T])
    case = {"title": "A focusing group"}
    return write_run(tmp_path / "run", case, gauges=two, surface=group(), tables={"energy.csv": (ENERGY, energy)})


def words(draw, tmp_path):
    """Return the text in a picture that ``draw`` makes, as SVG keeps it."""
    with rc_context({"svg.fonttype": "none"}):
        return draw(tmp_path / "picture.svg").read_text()


def test_the_standard_pictures_of_a_run_are_drawn_each_laid_out_once(run, monkeypatch):
    """Layouts, more than drawing, were what pictures cost."""
    layouts, execute = [], ConstrainedLayoutEngine.execute
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda *one: layouts.append(one) or execute(*one))
    pictures = draw_run(run)
    assert len(layouts) == 3
    assert [path.name for path in pictures] == ["surface.png", "gauges.png", "energy.png"]
    for path in pictures:
        pixels = imread(path)
        assert min(pixels.shape[:2]) > 200
        assert pixels[..., :3].std() > 0.05


def test_a_run_killed_at_its_start_gives_the_pictures_it_has_records_for(tmp_path):
    energy = np.array([[0.0] * 7, [0.1] * 7])
    run = write_run(tmp_path / "run", gauges=gauges()[:, :0], tables={"energy.csv": (ENERGY, energy)})
    assert [picture.name for picture in draw_run(run)] == ["energy.png"]


def test_the_surface_picture_names_crest_place_time_and_exaggeration(tmp_path):
    text = words(lambda path: surface_figure(group(), path, title="A focusing group", depth=1.0), tmp_path)
    crest = "t = 20.00 s, the highest crest of the snapshots", "10 cm at x = 10.00 m"
    axes = "elevation [cm]", "time [s]", "x [m]", ">paddle<", ">−5<"
    assert not [word for word in ("A focusing group", *crest, "vertical exaggeration", *axes) if word not in text]
    assert ">bed [m]<" not in text and ">sponge<" not in text


def test_a_ring_is_drawn_closed_and_no_water_below_the_bed(tmp_path):
    tank, x, t = {"type": "ring", "length": 8.0, "depth": 0.01}, np.arange(8.0), np.arange(4.0)
    waves = surface(t, x, 0.01 * np.cos(np.pi / 4 * (x - t[:, None])))
    run = write_run(tmp_path / "run", {"tank": tank, "wall": {"type": "fixed"}}, surface=waves)
    ring = closed(run.snapshots(), 8.0)
    assert np.all(ring.x[:, -1] == 8.0) and np.array_equal(ring.elevation[:, -1], ring.elevation[:, 0])
    text = words(lambda path: surface_figure(ring, path, depth=0.01, origin="along the ring"), tmp_path)
    assert "distance along the ring, x [m]" in text
    assert ">\u22121.0<" in text and ">\u22121.5<" not in text  # ticks [cm]
    assert figures.draw_surface(run).exists()


def test_a_varying_bed_is_drawn_at_its_depth(tmp_path):
    def shoal(x, y):
        return 1.0 - 0.5 * np.exp(-((x - 12.0) ** 2)) + y

    assert ">bed [m]<" in words(lambda path: surface_figure(group(), path, depth=shoal), tmp_path)
    axes, x = Figure().add_subplot(), np.linspace(0.0, 24.0, 241)
    figures._draw_bed(axes, x, shoal(x, 0 * x))
    water, sand = (np.concatenate([path.vertices for path in one.get_paths()]) for one in axes.collections)
    assert (water[:, 1].min(), water[:, 1].max()) == (pytest.approx(-1.0), 0.0)
    assert sand[:, 1].max() == pytest.approx(-0.5)


def test_the_comparison_names_gauges_sources_and_misfits(tmp_path):
    measured = gauges(*(record(x, source="measured") for x in (4.0, 10.0, 13.0)))
    computed = gauges(*(record(x, 0.9 * elevation(x, T)) for x in (10.0, 13.0)))
    published = gauges(record(10.0, 0.8 * elevation(10.0, T), "Published 2014"))
    text = words(lambda path: gauges_figure(measured, computed, [published], path), tmp_path)
    assert "gauge 10, x = 10 m;  nrms: computed 0.100, Published 2014 0.200" in text
    assert "gauge 13, x = 13 m;  nrms: computed 0.100<" in text
    assert "gauge 4" not in text
    assert "largest crest, t = 20.00 s" in text
    for word in (">measured<", ">computed<", ">Published 2014<", "elevation [cm]", "time [s]"):
        assert word in text


def test_misfits_of_all_records_cover_the_time_of_the_run(tmp_path):
    early, eta = T <= 20.0, elevation(10.0, T)
    wrong_later = record(10.0, np.where(early, 0.8 * eta, 5.0), "Published 2014")
    short = record(10.0, 0.9 * eta[early], t=T[early])
    records = gauges(record(10.0, source="measured")), gauges(short), [gauges(wrong_later)]
    text = words(lambda path: gauges_figure(*records, path), tmp_path)
    assert "nrms: computed 0.100, Published 2014 0.200" in text


def test_the_surface_of_a_slice_shows_its_gauges_and_sponge(tmp_path, monkeypatch):
    """Names where there is room: of two gauges at one place the first."""
    monkeypatch.setitem(STYLE, "figure.dpi", 130)
    named = gauges(*(record(x, name=name) for x, name in ((4.0, "near"), (10.0, "focus"), (10.01, "hidden"))))
    text = words(lambda path: surface_figure(group(), path, gauges=named, sponge=(20.0, 24.0)), tmp_path)
    assert all(f">{name}<" in text for name in ("near", "focus", "sponge")) and ">hidden<" not in text
    x, formula = group().x.values[0], {"type": "formula", "gamma": "max(0, x - 18)"}
    assert figures._sponge({"sponge": {"type": "end", "length": 5.0}}, x) == pytest.approx((19.0, 24.0), abs=0.2)
    assert figures._sponge({"sponge": formula}, x) == pytest.approx((18.0, 24.0), abs=0.1)
    assert figures._sponge({}, x) is None


def test_the_energy_picture_names_the_budget_and_its_units(run, tmp_path):
    def text(energy):
        return words(lambda path: energy_figure(energy, path), tmp_path)

    energy, total = text(run.energy), run.energy.total
    for word in ("kinetic", "potential", "total", "start + paddle work", "[m⁴/s²]", "time [s]", "energy error"):
        assert word in energy
    assert "absor" not in energy and "paddle absorption" in text(run.energy.assign(absorbed=total))
    fixed = text(run.energy.assign(paddle_work=0 * total))
    assert "start" in fixed and "paddle" not in fixed


def test_figures_without_data_are_refused(tmp_path):
    """Two runs are killed before their first snapshot."""
    path, partial = tmp_path / "a.png", Dataset({"kinetic": ("time", np.ones(2))}, {"time": [0.0, 1.0]})
    sponge = {"type": "end", "length": 2.0}
    killed = [
        write_run(
            tmp_path / kind, {"tank": {"type": kind, "length": 8.0}, "sponge": sponge}, surface=group()[{"time": []}]
        )
        for kind in ("ring", "slice")
    ]
    for draw, arguments, sentence in (
        *((figures.draw_surface, [run], "0 snapshots") for run in killed),
        (gauges_overview, [gauges(), path], "no gauge"),
        (gauges_figure, [gauges(record(1.0)), gauges(record(2.0)), [], path], "no gauge in common"),
        (energy_figure, [partial, path], "no values of potential, total"),
    ):
        with pytest.raises(InputError, match=sentence):
            draw(*arguments)
    assert not path.exists()


def test_pictures_need_neither_the_solver_nor_a_display():
    code = (
        "import sys, wavetank.plots.figures; "
        "sys.exit(any(name in sys.modules for name in ('dolfinx', 'petsc4py', 'mpi4py', 'matplotlib.pyplot')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_faults_of_pictures_are_detected(drawn, tmp_path):
    """Each fault that the pictures had, in a figure that has them all."""
    with picture(tmp_path / "a.png", 4, 3) as figure:
        axes = figure.subplots()
        axes.loglog([1.1, 1.9], [1.2, 1.8], "-", color="#0072b2", label="one")
        axes.loglog([1.1, 1.9], [1.8, 1.2], "-", color="#d55e00")
        axes.set(xlabel="time [s]", ylabel="error")
        axes.legend(loc="center")
        axes.text(1.4, 1.25, "a text")
        axes.text(1.42, 1.25, "another")
        axes.minorticks_off()
    found = "\n".join(faults(figure))
    for fault in (
        "0 numbers at 'time [s]'",
        "no unit at 'error'",
        "no legend says what #d55e00 is",
        "the legend lies on a curve",
        "'a text' lies on 'another'",
    ):
        assert fault in found
