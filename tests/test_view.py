"""Views of runs: oracles are the waves that were put in, and where a camera must show them."""

import io
import sys

import numpy as np
import pytest
from conftest import commanded
from imageio_ffmpeg import count_frames_and_secs
from matplotlib.image import imread
from PIL import Image
from records import gauge_array, refusal, surface, write_run
from rich.console import Console

from wavetank.base.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.plots import view
from wavetank.plots.surfaces import flume_surface, wave_history

LENGTH, DEPTH, HEIGHT = 8.0, 1.0, 0.1  # m
STEPS, PERIOD = 40, 2.0  # snapshots of one period [s]
SMALL = (480, 270)
TANK = {"type": "slice", "length": LENGTH, "depth": DEPTH}
TIMES = np.linspace(0.0, PERIOD, STEPS + 1)


def travelling(x, t):
    """Return a wave of one length to +x, its crest at x = 0 when t = 0."""
    return HEIGHT / 2 * np.cos(2 * np.pi * (x / LENGTH - t / PERIOD))


def record(path, tank=TANK, *, elevation=travelling, paddle=0.0, far=0.0, times=TIMES, title="", gauges=(), **fitted):
    """Write a run directory with an elevation(x, t), walls that move by so much, and gauges at some x [m]."""
    fixed = {"wall": {"type": "fixed"}, "far_wall": {"type": "fixed"}}
    x = np.linspace(0.0, LENGTH, 81)[: -1 if tank["type"] == "ring" else None]
    t, names = np.reshape(times, (-1, 1)), [str(n) for n, _ in enumerate(gauges, start=1)]
    moved = x + np.sin(2 * np.pi * t / PERIOD) * (paddle * (1 - x / LENGTH) + far * x / LENGTH)
    at = gauge_array(names, gauges, np.zeros(len(names)), times, np.zeros((len(names), len(times))))
    case = {"title": title, "tank": tank, "sponge": None, **fixed, **fitted}
    return write_run(path, case, gauges=at, surface=surface(times, moved, elevation(moved, t)))


@pytest.fixture
def run(tmp_path):
    return record(tmp_path / "run", title="A wave")


def place(picture, points):
    """Return where points [m], shape (N, 3), are in the picture [pixels]: columns and rows, shape (N, 2)."""
    width, height = picture.plotter.window_size
    matrix = picture.plotter.camera.GetCompositeProjectionTransformMatrix(width / height, -1.0, 1.0)
    composite = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    drawn = np.column_stack([points * (1.0, 1.0, picture.exaggeration), np.ones(len(points))])
    x, y, _, w = composite @ drawn.T
    return np.stack([(1 + x / w) / 2 * width, (1 - y / w) / 2 * height], axis=1)


def mesh(picture, name):
    """Return the points [m] of a mesh of a picture, shape (N, 3)."""
    return picture.plotter.actors[name].mapper.dataset.points / (1.0, 1.0, picture.exaggeration)


# ---------------------------------------------------------------- surfaces
def test_flume_surface_between_snapshots_is_the_wave(run):
    surface = flume_surface(run)
    for t in (0.0, 0.61, 1.99):
        x, y, eta = surface.at(t).T
        assert eta == pytest.approx(travelling(x, t), abs=5e-4 * HEIGHT)
        assert np.ptp(y) == pytest.approx(0.22 * LENGTH) and np.ptp(x) == pytest.approx(LENGTH)
    waves = wave_history(surface)
    assert waves.high.max() == pytest.approx(HEIGHT / 2, rel=1e-3) and waves.crest_time in TIMES


def test_ring_surface_closes_at_its_length(tmp_path):
    surface = flume_surface(record(tmp_path / "run", {**TANK, "type": "ring"}))
    x, _, eta = surface.first[:800].T
    assert x[-1] == pytest.approx(LENGTH) and eta == pytest.approx(travelling(x, 0.0), abs=1e-4)


@pytest.mark.parametrize(
    "sponge", [{"type": "end", "length": 2.0}, {"type": "formula", "gamma": "5 * (max(x - 6, 0) / 2)**2"}]
)
def test_sponge_damps_with_the_square_of_the_distance(tmp_path, sponge):
    surface = flume_surface(record(tmp_path / "run", sponge=sponge))
    rate = surface.damping / surface.damping.max()
    assert rate == pytest.approx(np.maximum(surface.first[:, 0] - 6.0, 0.0) ** 2 / 4.0, abs=1e-9)


# ---------------------------------------------------------------- pictures
def test_water_reaches_from_the_bed_to_the_surface_and_the_paddles_move(tmp_path):
    tank = {**TANK, "bed": {"type": "formula", "depth": "1 - x / 16"}}
    picture = view.View(record(tmp_path / "run", tank, paddle=0.1, far=0.2), size=SMALL)
    picture.draw(PERIOD / 4)
    x, _, z = mesh(picture, "sides").T
    foot = z < -0.1
    assert z[foot] == pytest.approx(np.minimum(x[foot], LENGTH) / 16 - 1, abs=0.02)  # depths of the points at rest
    assert z[~foot] == pytest.approx(travelling(x[~foot], PERIOD / 4), abs=1e-3)
    assert np.unique(mesh(picture, "paddle")[:, 0].round(4)) == pytest.approx([0.1, LENGTH + 0.2])
    picture.close()


def test_tank_fills_the_picture_which_says_title_time_and_exaggeration(run):
    picture = view.View(run, size=(960, 540))
    corners = np.array([[x, y, z] for x in (0, LENGTH) for y in (-0.88, 0.88) for z in (-DEPTH, HEIGHT / 2)])
    reached = np.abs(2 * place(picture, corners) / (960, 540) - 1).max(axis=0)
    assert np.all(reached < view.TANK_SIZE) and np.any(reached > 0.9 * np.array(view.TANK_SIZE))
    picture.draw(0.25)
    said = [picture.plotter.actors[name].GetText(n) for name, n in (("title", 2), ("time", 3), ("note", 0))]
    assert said == ["A wave", "t = 0.25 s", "vertical exaggeration 2"]  # 0.22 of 8 m over 1 m
    picture.close()


def test_low_waves_are_raised(tmp_path):
    """Oracle: waves of 1 mm in 8 m are drawn as high as 0.03 of the length, the bed by the usual exaggeration."""
    picture = view.View(record(tmp_path / "run", elevation=lambda x, t: 5e-4 * np.cos(x)), size=(160, 160))
    z = picture.plotter.actors["surface"].mapper.dataset.points[:, 2]
    assert np.ptp(z) == pytest.approx(0.03 * LENGTH, rel=0.2) and picture.exaggeration == 2.0
    bed = picture.plotter.actors["bed"].mapper.dataset.points[:, 2]
    assert bed.max() == pytest.approx(z.min() - 2 * (DEPTH - 5e-4), rel=1e-3)
    picture.close()


def test_crest_is_light_trough_dark_and_still_water_has_the_colour_of_the_bar(tmp_path):
    def hump(x, t):
        return HEIGHT * np.exp(-((x - 6.0) ** 2)) - HEIGHT * np.exp(-((x - 3.0) ** 2))

    picture = view.View(record(tmp_path / "run", elevation=hump), size=(960, 540))
    pixels = picture.pixels(0.0) / 255
    places = np.round(place(picture, np.array([[6.0, 0.0, HEIGHT], [3.0, 0.0, -HEIGHT], [0.4, 0.0, 0.0]]))).astype(int)
    crest, trough, still = (pixels[row, column] for column, row in places)
    assert crest.mean() > still.mean() + 0.2 > trough.mean() + 0.4
    assert still == pytest.approx(view.SURFACE(0.5)[:3], abs=0.05)  # lights sum to 1 there, a glint apart
    picture.close()


@pytest.mark.parametrize("count", [3, view.MAX_LABELS + 1])
def test_gauges_are_rods_with_names_unless_there_are_many(tmp_path, count):
    gauges = np.linspace(1.0, 7.0, count)
    picture = view.View(record(tmp_path / "run", gauges=gauges), size=SMALL)
    x, _, z = mesh(picture, "gauges").T
    assert x[::2] == pytest.approx(gauges) and (z.max() > 0.9 * HEIGHT) == (count == 3)
    picture.close()


@pytest.mark.parametrize(("suffix", "frames"), [(".gif", 51), (".mp4", 17)])
def test_film_of_a_short_run_lasts_four_seconds(run, tmp_path, monkeypatch, suffix, frames):
    """The video has a low frame rate here."""
    monkeypatch.setitem(view.FILMS, ".mp4", (4.0, view.FILMS[".mp4"][1]))
    path = view.film(run, tmp_path / f"film{suffix}", size=(160, 160), console=Console(file=io.StringIO()))
    if suffix == ".mp4":
        assert count_frames_and_secs(path)[0] == frames
        return
    with Image.open(path) as film:
        first = np.asarray(film.convert("RGB"), float)
        film.seek(film.n_frames // 2)
        assert np.abs(np.asarray(film.convert("RGB"), float) - first).mean() > 3  # of 255
        assert film.n_frames == frames and film.size == (160, 160)


@pytest.mark.parametrize("kind", ["slice", "ring"])
def test_a_single_snapshot_makes_a_still(tmp_path, kind):
    run = record(tmp_path / "run", {**TANK, "type": kind}, times=[0.5])
    assert imread(view.still(run, tmp_path / "still.png", size=SMALL))[..., :3].std() > 0.1


# ---------------------------------------------------------------- the command
def test_view_draws_a_still_by_default(run, tmp_path):
    done = commanded("view", str(run.path), "--size", "300x200")
    assert done.returncode == 0 and f"wrote {run.path / 'view.png'}" in done.stdout.replace("\n", "")
    words = ("--diagram", "--time", "1.0", "--out", str(tmp_path / "a.png"), "--size", "300x200")
    assert commanded("view", str(run.path), *words).returncode == 0
    assert imread(tmp_path / "a.png").shape[:2] == (200, 300)
    assert (run.path / "surface.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("option", "value", "sentence"),
    [
        ("--time", "2.5", "time 2.5 s received; allowed is 0 to 2 s"),
        ("--time", "-1", "time -1 s received"),
        ("--time", "nan", "time nan s received"),
        ("--size", "large", "size 'large' received; allowed is WIDTHxHEIGHT"),
        ("--size", "20x2000", "size 20x2000 received; allowed are 160 to 8000"),
        ("--out", "RUN/still.jpg", "still.jpg: a still is written as .png"),
        ("--out", "RUN/manifest.json/still.png", "still.png: cannot be written"),
        ("--film", "RUN/film.avi", "allowed are .mp4, .gif"),
        ("--film", "RUN/manifest.json/film.gif", "film.gif: cannot be written"),
    ],
)
def test_invalid_view_is_refused_and_leaves_no_file(run, monkeypatch, option, value, sentence):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    before = sorted(run.path.iterdir())
    assert sentence in refusal("view", str(run.path), option, value.replace("RUN", str(run.path)))
    assert sorted(run.path.iterdir()) == before


@pytest.mark.parametrize(
    ("draw", "made", "sentence"),
    [
        (view.still, {"times": []}, "has no snapshot of the surface"),
        (view.film, {"times": [0.0]}, "has 1 snapshot of the surface; at least 2"),
        (view.still, {"tank": {**TANK, "type": "sphere"}}, "type 'sphere'; can be viewed: slice, ring, basin"),
        (view.still, {"tank": {"type": "slice", "length": 1.0}}, "does not say the tank's depth"),
        (view.still, {"times": [1.0, 0.0]}, "its snapshots are damaged"),
        (view.still, None, r"no readable surface\.nc"),
    ],
)
def test_runs_without_waves_to_view_are_refused(tmp_path, draw, made, sentence):
    run = record(tmp_path / "run", **(made or {"times": [0.0]}))
    if made is None:
        (run.path / "surface.nc").unlink()
    with pytest.raises(InputError, match=sentence):
        draw(RunDirectory(run.path), tmp_path / f"a.{'gif' if draw is view.film else 'png'}")
    assert not list(tmp_path.glob("a.*"))
    assert "is no run directory" in refusal("view", str(tmp_path / "none"))


def test_a_missing_package_is_named(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "wavetank.plots.view", None)
    monkeypatch.delattr("wavetank.plots.view")
    assert "is needed: pip install 'wavetank[view]'" in refusal("view", str(run.path))
