"""Pictures of a run: they exist, say what they show with units, and interpolate a known group to known accuracy."""

import re
import shutil
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.layout_engine import ConstrainedLayoutEngine
from records import gauge, gauges, surface
from scipy.optimize import brentq
from xarray import Dataset

from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.writer import RunWriter
from wavetank.plots import figures
from wavetank.plots.figures import draw_run, energy_figure, gauges_figure, gauges_overview, surface_figure
from wavetank.plots.style import STYLE, mark_places

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
    snapshots = group()
    with RunWriter(tmp_path / "run", {"scene": {"title": "A focusing group"}}) as writer:
        table, energy, snapshot = (
            writer.gauges([("1", 4.0), ("2", 10.0)]),
            writer.table("energy.csv", ENERGY),
            writer.surface(),
        )
        for t, x, eta in zip(T, snapshots.x.values, snapshots.elevation.values, strict=True):
            table.append([t, elevation(4.0, t), elevation(10.0, t)])
            energy.append([t, 0.1 * t, 0.2 * t, 0.3 * t, 0.3 * t, 1e-6 * np.sin(t), 24.0])
            snapshot.append(t, x, eta, 0 * eta)
        writer.finish("finished", {})
    return RunDirectory(tmp_path / "run")


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
    assert [picture.name for picture in pictures] == ["surface.png", "gauges.png", "energy.png"]
    for picture in pictures:
        pixels = imread(picture)
        assert min(pixels.shape[:2]) > 200
        assert pixels[..., :3].std() > 0.05


def test_a_run_killed_at_its_start_gives_the_pictures_it_has_records_for(tmp_path):
    with RunWriter(tmp_path / "run", {}) as writer:
        writer.gauges([]), writer.surface()
        energy = writer.table("energy.csv", ENERGY)
        energy.append([0.0] * 7)
        energy.append([0.1] * 7)
    assert [picture.name for picture in draw_run(RunDirectory(tmp_path / "run"))] == ["energy.png"]


def test_the_surface_picture_names_crest_place_time_and_exaggeration(tmp_path):
    text = words(lambda path: surface_figure(group(), path, title="A focusing group", depth=1.0), tmp_path)
    crest = "t = 20.00 s, the highest crest of the snapshots", "10 cm at x = 10.00 m"
    for word in ("A focusing group", *crest, "vertical exaggeration"):
        assert word in text
    for axis in ("elevation [cm]", "time [s]", "x [m]", ">paddle<", ">−5<"):
        assert axis in text
    assert ">bed [m]<" not in text and ">sponge<" not in text


def test_before_and_after_are_half_a_period_away():
    t, x = np.linspace(0.0, 10.0, 401), np.broadcast_to(np.linspace(0.0, 2.0, 21), (401, 21))
    omega = 5.0
    standing = np.cos(np.pi * x) * np.cos(omega * (t - 4.0))[:, None]
    assert figures._half_period(standing) * 0.025 == pytest.approx(np.pi / omega, abs=0.05)  # two snapshots


def test_a_tank_of_fixed_walls_and_still_water_are_drawn_too(tmp_path):
    x = np.broadcast_to(np.linspace(0.0, 2.0, 21), (5, 21))
    text = words(lambda path: surface_figure(surface(np.arange(5.0), x, 0 * x), path), tmp_path)
    assert "0 cm at x = 0.00 m" in text
    assert ">paddle<" not in text and ">far wall<" not in text
    moved = x + 0.05 * np.arange(5)[:, None] * x
    text = words(lambda path: surface_figure(surface(np.arange(5.0), moved, 0 * x), path), tmp_path)
    assert ">paddle<" not in text and ">far wall<" in text


def test_a_ring_is_drawn_closed_and_no_water_below_the_bed(tmp_path):
    tank = {"type": "ring", "length": 8.0, "depth": 0.01}
    with RunWriter(tmp_path / "run", {"scene": {"tank": tank, "wall": {"type": "fixed"}}}) as writer:
        x = np.arange(8.0)
        record = writer.surface()
        for t in range(4):
            record.append(t, x, 0.01 * np.cos(np.pi / 4 * (x - t)), 0 * x)
    run = RunDirectory(tmp_path / "run")
    ring = figures._closed(run.snapshots(), 8.0)
    assert np.all(ring.x[:, -1] == 8.0) and np.array_equal(ring.elevation[:, -1], ring.elevation[:, 0])
    text = words(lambda path: surface_figure(ring, path, depth=0.01, origin="along the ring"), tmp_path)
    assert "distance along the ring, x [m]" in text
    assert ">\u22121.0<" in text and ">\u22121.5<" not in text  # ticks [cm]
    assert figures.draw_surface(run).exists()


def test_cells_of_high_order_are_drawn_as_curves_between_their_nodes(tmp_path, monkeypatch):
    """Oracle: quartics, which cells of order 4 hold exactly; nodes as the mesh has them, at Gauss-Lobatto's places."""
    drawn = []
    monkeypatch.setattr(figures, "surface_figure", lambda shown, path, **_: drawn.append(shown) or path)
    within = 0.5 + 0.5 * np.array([-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7)])
    nodes = np.append((np.arange(3)[:, None] + within).ravel(), 3.0)
    tank = {"type": "slice", "length": 3.0, "depth": 1.0}
    for chosen in ({"scene": {"tank": tank, "numerics": {"order": 4}}}, {"planned": {"numerics": {"order": 4}}}):
        with RunWriter(tmp_path / "run", chosen) as writer:
            record = writer.surface()
            for t in range(2):
                record.append(t, nodes, 0.01 * nodes**4 + t, 0 * nodes)
        figures.draw_surface(RunDirectory(tmp_path / "run"))
        shown = drawn.pop()
        x = shown.x.values
        assert x.shape[1] == 1201 and np.all(np.diff(x) > 0)
        assert shown.elevation.values == pytest.approx(0.01 * x**4 + shown.time.values[:, None], abs=1e-12)
        shutil.rmtree(tmp_path / "run")


def test_a_varying_bed_is_drawn_at_its_depth(tmp_path):
    def shoal(x, y):
        return 1.0 - 0.5 * np.exp(-((x - 12.0) ** 2)) + y

    assert ">bed [m]<" in words(lambda path: surface_figure(group(), path, depth=shoal), tmp_path)
    axes, x = Figure().add_subplot(), np.linspace(0.0, 24.0, 241)
    figures._draw_bed(axes, x, shoal(x, 0 * x))
    water, sand = (np.concatenate([path.vertices for path in one.get_paths()]) for one in axes.collections)
    assert (water[:, 1].min(), water[:, 1].max()) == (pytest.approx(-1.0), 0.0)
    assert sand[:, 1].max() == pytest.approx(-0.5)


def test_a_slices_bed_is_read_from_its_scene(tmp_path, monkeypatch):
    drawn = {}
    monkeypatch.setattr(figures, "surface_figure", lambda _, path, **given: drawn.update(given) or path)
    bed = {"type": "formula", "depth": "0.6 - 0.01 * x"}
    for name, tank in (("sloping", {"bed": bed}), ("flat", {})):
        scene = {"tank": {"type": "slice", "length": 8.0, "depth": 0.6, **tank}}
        with RunWriter(tmp_path / name, {"scene": scene}) as writer:
            record = writer.surface()
            for t in range(2):
                record.append(t, *3 * [np.arange(9.0)])
        figures.draw_surface(RunDirectory(tmp_path / name))
        depth = drawn["depth"]
        assert depth == 0.6 if name == "flat" else depth(np.array([5.0]), np.zeros(1)) == pytest.approx(0.55)


def test_the_space_time_diagram_interpolates_the_group():
    moved = group().x.values
    drawn = figures._resampled(T, moved, group().elevation.values)
    x, t = (np.linspace(0.0, 24.0, size) for size in (drawn.shape[1], drawn.shape[0]))
    x = moved.min() + (moved.max() - moved.min()) * x / 24.0
    exact = elevation(x[None, :], t[::5, None])
    wet = x[None, :] > 0.06  # the paddle's largest excursion
    # linear in x: (dx k)^2 / 8 = 0.011 at dx = 1/15 m and k = 4.4 rad/m
    assert np.abs(np.where(wet, drawn[::5] - exact, 0.0)).max() < 0.011 * AMPLITUDE


def test_one_sharp_crest_does_not_bleach_the_other_waves():
    x = np.broadcast_to(np.linspace(0.0, 20.0, 401), (50, 401))
    eta = 0.01 * np.sin(2.0 * x)
    eta[25, 200] = 1.0
    figure = Figure()
    axes = figure.add_subplot()
    figures._draw_diagram(figure, axes, np.arange(50.0), x, eta)
    # 1 cm is the waves' height, 100 cm the crest's; 401 points meet a wave's top to (k dx / 2)^2 / 2 = 1e-3
    assert axes.images[0].get_clim() == pytest.approx((-1.0, 1.0), rel=1e-3)


def test_exaggeration_is_one_where_the_scales_are_equal():
    figure = Figure(figsize=(8, 4))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0.0, 2.0), ylim=(0.0, 100.0))  # 2 m by 100 cm in 8 by 4 inch
    assert figures._exaggeration(axes) == 1.0
    axes.set_ylim(0.0, 10.0)
    assert figures._exaggeration(axes) == 10.0


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


def test_all_misfits_are_of_the_time_that_the_run_has(tmp_path):
    early, eta = T <= 20.0, elevation(10.0, T)
    wrong_later = record(10.0, np.where(early, 0.8 * eta, 5.0), "Published 2014")
    short = record(10.0, 0.9 * eta[early], t=T[early])
    records = gauges(record(10.0, source="measured")), gauges(short), [gauges(wrong_later)]
    text = words(lambda path: gauges_figure(*records, path), tmp_path)
    assert "nrms: computed 0.100, Published 2014 0.200" in text


def test_a_comparison_is_drawn_over_the_time_that_both_have():
    """The crest is 1 s from the end of the run: nothing that comes later is drawn."""
    full, zoom = Figure().subplots(1, 2)
    figures._draw_gauge(full, zoom, record(10.0, source="measured"), [record(10.0, t=T[T <= 21.0])])
    assert zoom.get_xlim() == pytest.approx((16.0, 21.0))
    for line in (*full.lines, *zoom.lines):
        assert line.get_xdata().max() <= 21.0


def test_the_overview_orders_gauges_from_the_paddle_outwards(tmp_path):
    text = words(lambda path: gauges_overview(gauges(record(10.0), record(4.0)), path), tmp_path)
    assert 0 < text.index("x = 4 m") < text.index("x = 10 m")


def test_gauges_across_a_basin_have_their_y_and_what_is_no_wave_is_flat(tmp_path):
    across = [record(4.0, 1e-9 * np.sin(T), name=f"across/{n}", y=float(n - 2)) for n in (1, 2, 3)]
    text = words(lambda path: gauges_overview(gauges(*across), path), tmp_path)
    assert all(f">gauge across/{n}, x = 4 m, y = {n - 2} m<" in text for n in (1, 2, 3))
    assert "1e" not in "".join(re.findall(r">([^<>]*)</text>", text))
    assert "y = " not in words(lambda path: gauges_overview(gauges(record(4.0)), path), tmp_path)


@pytest.mark.parametrize(("number", "shape"), [(8, (8, 1)), (9, (5, 2))])
def test_many_gauges_are_drawn_in_two_columns(number, shape, tmp_path, drawn):
    gauges_overview(gauges(*(record(float(n)) for n in range(number))), tmp_path / "gauges.png")
    (figure,) = drawn
    assert figure.axes[0].get_gridspec().get_geometry() == shape
    titles = [panel.get_title("left") for panel in figure.axes if panel.axison]
    assert sorted(titles) == [f"gauge {n}, x = {n} m" for n in range(number)]


def test_the_surface_of_a_slice_shows_its_gauges_and_sponge(tmp_path, monkeypatch):
    """Names where there is room: of two gauges at one place the first."""
    monkeypatch.setitem(STYLE, "figure.dpi", 130)
    named = gauges(*(record(x, name=name) for x, name in ((4.0, "near"), (10.0, "focus"), (10.01, "hidden"))))
    text = words(lambda path: surface_figure(group(), path, gauges=named, sponge=(20.0, 24.0)), tmp_path)
    assert all(f">{name}<" in text for name in ("near", "focus", "sponge")) and ">hidden<" not in text
    x, formula = group().x.values[0], {"type": "formula", "gamma": "max(0, x - 18)"}
    assert figures._sponge({"sponge": {"type": "end", "length": 5.0}}, x) == (19.0, 24.0)
    assert figures._sponge({"sponge": formula}, x) == pytest.approx((18.0, 24.0), abs=0.1)
    assert figures._sponge({}, x) is None


def test_a_row_of_gauges_has_one_name_on_a_map():
    axes, row = Figure().add_subplot(), [record(4.0, name=f"across/{n}", y=float(n)) for n in range(1, 18)]
    mark_places(axes, gauges(record(2.0, name="alone"), *row), rows={"across"})
    assert [text.get_text() for text in axes.texts] == ["alone", "across"]
    assert axes.texts[1].xy == (4.0, 1.0)
    assert all(line.get_marker() == "+" and line.get_markersize() >= 4 for line in axes.lines)


def test_the_energy_picture_names_the_budget_and_its_units(run, tmp_path):
    energy = run.energy
    text = words(lambda path: energy_figure(energy, path), tmp_path)
    for word in ("kinetic", "potential", "total", "start + paddle work", "[m⁴/s²]", "time [s]", "energy error"):
        assert word in text
    assert "absor" not in text
    absorbing = energy.assign(absorbed=energy.total)
    assert "paddle absorption" in words(lambda path: energy_figure(absorbing, path), tmp_path)
    fixed = energy.assign(paddle_work=0 * energy.paddle_work)
    text = words(lambda path: energy_figure(fixed, path), tmp_path)
    assert "start" in text and "paddle" not in text


def test_the_balance_is_drawn_over_the_energy_that_it_is_judged_by():
    """Of 1 J that is there at the end, 3 J dissipated and 6 J absorbed: 0.1 J are a hundredth."""
    axes = Figure().add_subplot()
    last = {"balance": 0.1, "total": 1.0, "dissipated": 3.0, "absorbed": 6.0}
    energy = Dataset({name: ("time", [0.0, value]) for name, value in last.items()}, {"time": [0.0, 1.0]})
    figures._draw_balance(axes, energy)
    assert axes.lines[0].get_ydata() == pytest.approx([0.0, 0.01])


def test_nothing_to_draw_is_bad_input(tmp_path):
    for tank in ({"type": "ring", "length": 8.0}, {"type": "slice", "length": 8.0}):  # killed before the first
        with RunWriter(tmp_path / tank["type"], {"scene": {"tank": tank, "sponge": {"type": "end", "length": 2.0}}}):
            pass
        (tmp_path / tank["type"] / "surface.nc").touch()
        with pytest.raises(InputError, match="0 snapshots"):
            figures.draw_surface(RunDirectory(tmp_path / tank["type"]))
    with pytest.raises(InputError, match="no gauge"):
        gauges_overview(gauges(), tmp_path / "a.png")
    with pytest.raises(InputError, match="no gauge in common"):
        gauges_figure(gauges(record(1.0)), gauges(record(2.0)), [], tmp_path / "a.png")
    with pytest.raises(InputError, match="no values of potential, total"):
        energy_figure(Dataset({"kinetic": ("time", np.ones(2))}, {"time": [0.0, 1.0]}), tmp_path / "a.png")
    assert not (tmp_path / "a.png").exists()


def test_pictures_need_neither_the_solver_nor_a_display():
    code = (
        "import sys, wavetank.plots.figures; "
        "sys.exit(any(name in sys.modules for name in ('dolfinx', 'petsc4py', 'mpi4py', 'matplotlib.pyplot')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
