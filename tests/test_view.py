"""Views of runs: oracles are the waves that were put in, and where a camera must show them."""

import io

import numpy as np
import pytest
import typer
from imageio_ffmpeg import count_frames_and_secs
from matplotlib.image import imread
from mpi4py import MPI
from PIL import Image
from rich.console import Console
from typer.testing import CliRunner

from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.writer import RunWriter
from wavetank.plots import tank_scene, view, view_command

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
    scene = {"title": title, "tank": tank, "sponge": None, **fixed, **fitted}
    with RunWriter(path, {"scene": scene}) as writer:
        surface, table = writer.surface(), writer.gauges([(str(n), x) for n, x in enumerate(gauges, start=1)])
        x = np.linspace(0.0, LENGTH, 81)[: -1 if tank["type"] == "ring" else None]
        for t in times:
            moved = x + np.sin(2 * np.pi * t / PERIOD) * (paddle * (1 - x / LENGTH) + far * x / LENGTH)
            surface.append(t, moved, elevation(moved, t), 0 * x)
            table.append([t, *(0.0 for _ in gauges)])
    return RunDirectory(path)


@pytest.fixture
def run(tmp_path):
    return record(tmp_path / "run", title="A wave")


@pytest.mark.parametrize("far", [pytest.param(False, id="near"), pytest.param(True, marks=pytest.mark.slow, id="far")])
def test_a_flap_leans_and_the_water_beside_it(tmp_path, far):
    """Both are on its line x = (z - z_h) / (d - hinge) X above the hinge, and at x = 0 below it, x from the flap."""
    hinge, moved = 0.3, 0.2
    flap = {"type": "flap", "hinge": hinge, "motion": {"type": "at-rest"}}
    wall, mirror = {"wall": flap, "paddle": moved}, {"far_wall": flap, "far": -moved}
    mirror["elevation"] = lambda x, t: travelling(LENGTH - x, t)
    tank = tank_scene.tank_view(record(tmp_path / "run", **(mirror if far else wall)))
    meshes = tank.at(PERIOD / 4)
    eta = travelling(moved, PERIOD / 4)
    X = moved * (DEPTH - hinge) / (DEPTH - hinge + eta)
    for mesh in (meshes["paddle"], meshes["sides"]):
        x, _, z = mesh.points.T
        x = LENGTH - x if far else x
        line = X * np.maximum(z + DEPTH - hinge, 0.0) / (DEPTH - hinge)
        on_it = np.abs(x - line) < 1e-6
        assert on_it.sum() > 20 and z[on_it].min() == pytest.approx(-DEPTH) and np.ptp(line[on_it]) > 0.9 * X
    assert x.min() == pytest.approx(0.0, abs=1e-6)
    assert tank.fixed()["glass"].bounds[0 if far else 1] == pytest.approx(-0.0066 * LENGTH if far else 1.0066 * LENGTH)


@pytest.fixture(scope="module")
def standing_wave(tmp_path_factory):
    """Return a computed run: a standing wave, a little more than half a period of it."""
    from wavetank.case import Case
    from wavetank.recording import record_run

    tank = {"type": "slice", "length": 2.0, "depth": 1.0}
    initial = {"type": "standing-wave", "wave_amplitude": 0.1}
    numerics = {"cells": 8, "vertical_order": 4, "dt": 0.045}
    content = {"tank": tank, "initial": initial, "numerics": numerics, "run": {"duration": 0.9}}
    path = tmp_path_factory.mktemp("view") / "standing"
    record_run(Case.model_validate(content), path, comm=MPI.COMM_SELF, console=Console(quiet=True))
    return RunDirectory(path)


def skyline(pixels, columns):
    """Return the uppermost row that is not sky, in each of these columns; the sky is the same along a row."""
    sky = pixels[:, :1].astype(int)
    return np.array([np.flatnonzero(np.abs(pixels[:, c] - sky[:, 0]).sum(axis=1) > 6)[0] for c in columns])


def far_edge(tank, x, eta):
    return np.stack([x, np.full_like(x, tank.width / 2), eta], axis=1)


def assert_skyline(picture, t, x, eta):
    """The water's far edge is seen at x [m] and eta [m]; smoothing reaches into one or two rows above it."""
    columns, rows = picture.place(far_edge(picture.tank, x, eta)).T
    still_water = picture.place(far_edge(picture.tank, x, 0 * x))[:, 1]
    assert np.ptp(rows - still_water) > 30  # what is told apart
    there = np.round(columns).astype(int)
    expected = np.interp(there + 0.5, columns, rows)  # at the pixels' middles
    assert skyline(picture.pixels(t), there) + 1.0 == pytest.approx(expected, abs=1.6)


# ---------------------------------------------------------------- stills
def test_a_standing_waves_crest_is_seen_at_one_wall_and_half_a_period_later_at_the_other(standing_wave):
    tank = tank_scene.tank_view(standing_wave)
    picture = view.View(tank, "", size=(960, 540))
    x = np.linspace(0.3, 1.7, 15)  # clear of the walls' plates
    assert_skyline(picture, 0.0, x, 0.1 * np.cos(np.pi * x / 2.0))
    omega = np.sqrt(9.81 * np.pi / 2 * np.tanh(np.pi / 2))  # linear; (k a)^2 = 2 % changes it by as much at most
    turned = 0.1 * np.cos(np.pi * x / 2.0) * np.cos(omega * (later := np.pi / omega))
    profile = tank.at(later)["surface"].points
    eta = np.interp(x, profile[: len(profile) // 2, 0], profile[: len(profile) // 2, 2])
    assert eta == pytest.approx(turned, abs=0.02)  # the second harmonic, k a^2 / 2 and its like
    assert_skyline(picture, later, x, eta)
    picture.close()


def test_a_crest_is_light_a_trough_dark_and_still_water_has_the_colour_of_the_bar(tmp_path):
    def hump(x, t):
        return HEIGHT * np.exp(-((x - 6.0) ** 2)) - HEIGHT * np.exp(-((x - 3.0) ** 2))

    picture = view.View(tank_scene.tank_view(record(tmp_path / "run", elevation=hump)), "", size=(960, 540))
    pixels = picture.pixels(0.0) / 255
    places = np.round(picture.place(np.array([[6.0, 0.0, HEIGHT], [3.0, 0.0, -HEIGHT], [0.4, 0.0, 0.0]]))).astype(int)
    crest, trough, still = (pixels[row, column] for column, row in places)
    assert crest.mean() > still.mean() + 0.2 > trough.mean() + 0.4
    assert still == pytest.approx(view.SURFACE(0.5)[:3], abs=0.05)  # lights sum to 1 there, a glint apart
    picture.close()


def test_the_picture_says_title_time_unit_and_exaggeration(run):
    picture = view.View(tank_scene.tank_view(run), "A wave", size=SMALL)
    picture.draw(0.25)
    said = {name: picture.plotter.actors[name].input for name in ("title", "time", "bar", "note")}
    # 0.12 of 8 m over 0.1 m is 9.6; 0.22 of 8 m over 1 m, which is less, is 1.76
    assert said == {"title": "A wave", "time": "t = 0.25 s", "bar": "elevation [cm]", "note": "vertical exaggeration 2"}
    picture.note_pace(2.5)
    assert picture.plotter.actors["note"].input == "vertical exaggeration 2, 2.5 times as fast"
    picture.close()


# ---------------------------------------------------------------- what is read off
def test_the_vertical_ruler_stands_left_of_the_tank_with_heights_at_their_heights(run):
    """Exaggerated as waves are: the tick of still water is as high as still water, the lowest as the bed."""
    picture = view.View(tank := tank_scene.tank_view(run), "", size=(960, 540))
    labels = tank.ruler().labels
    assert labels.texts == ["z = 0 m", "-0.2", "-0.4", "-0.6", "-0.8", "-1"]
    assert labels.places[:, 2] == pytest.approx(np.linspace(0.0, -1.0, 6))
    columns, rows = picture.place(labels.places).T
    (left, water), (_, bed) = picture.place(np.array([[0.0, -tank.width / 2, z] for z in (0.0, -DEPTH)]))
    assert np.all(columns < left) and np.all(columns > 0.03 * 960)
    assert abs(rows[0] - water) < 0.1 * (bed - water) and abs(rows[-1] - bed) < 0.1 * (bed - water)
    picture.close()


@pytest.mark.parametrize(
    "sponge", [{"type": "end", "length": 2.0}, {"type": "formula", "gamma": "5 * (max(x - 6, 0) / 2)**2"}]
)
def test_a_sponge_covers_the_surface_as_it_damps(tmp_path, sponge):
    """Oracle: gamma over its largest, ((x - 6 m) / 2 m)²; the colour covers with its root."""
    tank = tank_scene.tank_view(record(tmp_path / "run", sponge=sponge))
    sponge = tank.at(0.0)["sponge"]
    x = sponge.points[:, 0]
    cover = sponge[tank_scene.COVER][:, 3] / tank_scene.OPACITY
    assert cover == pytest.approx(np.clip((x - 6.0) / 2.0, 0.0, 1.0), abs=0.01)
    assert tank.note == "sponge: violet"
    assert "sponge" not in tank_scene.tank_view(record(tmp_path / "other")).at(0.0)


# ---------------------------------------------------------------- meshes
def test_between_snapshots_the_waves_go_on(run):
    t = TIMES[20] + 0.5 * (TIMES[1] - TIMES[0])
    surface = tank_scene.tank_view(run).at(t)["surface"]
    x, _, z = surface.points.T
    # the spline's (omega dt)^4 / 384 is 2e-6; a straight line's (omega dt)^2 / 8 would be 3e-3
    assert z == pytest.approx(travelling(x, t), abs=1e-4 * HEIGHT)
    assert surface[tank_scene.ELEVATION] == pytest.approx(100 * z, abs=1e-5)


def test_the_paddle_moves_with_the_water(tmp_path):
    tank = tank_scene.tank_view(record(tmp_path / "run", paddle=0.2))
    for t, x in ((0.5, 0.2), (1.5, -0.2)):
        meshes = tank.at(t)
        assert meshes["paddle"].bounds[1] == pytest.approx(x, abs=1e-6)
        assert meshes["surface"].bounds[0] == meshes["sides"].bounds[0] == pytest.approx(x, abs=1e-6)
        assert tank.fixed()["bed"].bounds[0] < meshes["paddle"].bounds[0]
    assert "paddle" not in tank_scene.tank_view(record(tmp_path / "still")).at(0.5)


@pytest.mark.parametrize(("bed", "slope"), [(None, 0.0), ({"type": "formula", "depth": "1.2 - 0.1 * x"}, 0.1)])
def test_a_slices_water_reaches_from_its_bed_to_the_surface(tmp_path, bed, slope):
    """Oracle: the depth d - slope x, beyond the tank's ends as at them."""
    deepest = 1.2 if bed else DEPTH
    tank = tank_scene.tank_view(record(tmp_path / "run", {**TANK, "bed": bed}, paddle=0.2))
    assert tank.depth == pytest.approx(deepest)
    assert tank.fixed()["glass"].bounds[4] == pytest.approx(slope * LENGTH - deepest)  # the far wall stands on the bed
    sides = tank.at(0.5)["sides"].points
    foot = sides[sides[:, 2] < -0.1]
    assert foot[:, 2] == pytest.approx(slope * foot[:, 0].clip(0.0) - deepest, abs=1e-6)
    assert sides[:, 2].max() == pytest.approx(HEIGHT / 2, rel=0.01)
    x, _, z = tank.fixed()["bed"].points.T
    top = z > -deepest - 0.05
    assert z[top] == pytest.approx(slope * x[top].clip(0.0, LENGTH) - deepest, abs=1e-6)
    assert z[~top] == pytest.approx(-deepest * (1 + tank_scene.SLAB))


def test_a_ring_is_bent_to_a_closed_circle(tmp_path):
    tank = tank_scene.tank_view(record(tmp_path / "run", {**TANK, "type": "ring"}))
    surface = tank.at(PERIOD / 4)["surface"]  # the crest is at x = LENGTH / 4: anticlockwise from the front, the right
    rows = surface.points.reshape(2, -1, 3)
    assert rows[:, 0] == pytest.approx(rows[:, -1], abs=1e-6)
    middle = rows.mean(axis=0)
    crest = middle[np.argmax(middle[:, 2])]
    radius = LENGTH / (2 * np.pi)
    assert crest == pytest.approx([radius, 0.0, HEIGHT / 2], abs=0.01)  # 800 places around
    assert np.hypot(middle[:, 0], middle[:, 1]) == pytest.approx(radius, rel=1e-6)
    assert [*tank.fixed()] == ["bed"] and "paddle" not in tank.at(0.0)


@pytest.mark.parametrize("kind", ["slice", "ring"])
def test_a_single_snapshot_makes_a_still(tmp_path, kind):
    run = record(tmp_path / "run", {**TANK, "type": kind}, times=[0.5])
    assert imread(view.still(run, tmp_path / "still.png", size=SMALL))[..., :3].std() > 0.1


# ---------------------------------------------------------------- films
def test_films_have_the_number_of_frames_given_and_move(run, tmp_path, monkeypatch):
    drawn, draw = [], view.View.draw
    monkeypatch.setattr(view.View, "draw", lambda self, t: drawn.append(t) or draw(self, t))
    gif = view.film(run, tmp_path / "film.gif", size=SMALL, frames=5, console=Console(file=io.StringIO()))
    assert drawn[-5:] == pytest.approx(np.linspace(0.0, PERIOD, 5))
    with Image.open(gif) as film:
        assert (film.n_frames, film.size) == (5, SMALL)
        frames = []
        for n in range(2):
            film.seek(n)
            frames.append(np.asarray(film.convert("RGB"), float))
    assert np.abs(frames[1] - frames[0]).mean() > 3  # of 255
    mp4 = view.film(run, tmp_path / "film.mp4", size=(321, 200), frames=4)
    assert count_frames_and_secs(mp4)[0] == 4


# ---------------------------------------------------------------- the command
def command(*arguments):
    app = typer.Typer()
    app.command()(view_command.view)
    return CliRunner().invoke(app, list(map(str, arguments)))


def test_the_command_makes_a_still_by_default_and_what_else_is_asked_for(run, tmp_path):
    done = command(run.path, "--size", "300x200")
    assert done.exit_code == 0 and f"wrote {run.path / 'view.png'}" in done.output.replace("\n", "")
    done = command(run.path, "--diagram", "--time", 1.0, "--out", tmp_path / "a.png", "--size", "300x200")
    assert done.exit_code == 0
    assert imread(tmp_path / "a.png").shape[:2] == (200, 300)
    assert (run.path / "surface.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["--time", "2.5"], "time 2.5 s received; allowed is 0 to 2 s"),
        (["--time", "-1"], "time -1 s received"),
        (["--time", "nan"], "time nan s received"),
        (["--size", "large"], "size 'large' received; allowed is WIDTHxHEIGHT"),
        (["--size", "20x2000"], "size 20x2000 received; allowed are 160 to 8000"),
        (["--out", "still.jpg"], "still.jpg: a still is written as .png"),
        (["--out", "manifest.json/still.png"], "still.png: cannot be written"),
        (["--film", "film.avi"], "allowed are .mp4, .gif"),
        (["--film", "manifest.json/film.gif"], "film.gif: cannot be written"),
        (["--window"], "a window needs a display"),
    ],
)
def test_what_cannot_be_viewed_is_refused_and_leaves_no_file(run, monkeypatch, arguments, sentence):
    monkeypatch.chdir(run.path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    before = sorted(run.path.iterdir())
    error = command(run.path, *arguments).exception
    assert isinstance(error, InputError) and sentence in str(error) and "\n" not in str(error)
    assert sorted(run.path.iterdir()) == before


def test_runs_without_waves_to_view_are_refused(tmp_path):
    with pytest.raises(InputError, match="is no run directory"):
        raise command(tmp_path / "none").exception
    with pytest.raises(InputError, match="has no snapshot of the surface"):
        view.still(record(tmp_path / "a", times=[]), tmp_path / "a.png")
    with pytest.raises(InputError, match="has 1 snapshot of the surface; at least 2"):
        view.film(record(tmp_path / "b", times=[0.0]), tmp_path / "b.gif")
    with pytest.raises(InputError, match="type 'sphere'; can be viewed: slice, ring, basin"):
        view.still(record(tmp_path / "c", {**TANK, "type": "sphere"}), tmp_path / "c.png")
    with pytest.raises(InputError, match="does not say the tank's depth"):
        view.still(record(tmp_path / "d", {"type": "slice", "length": 1.0}), tmp_path / "d.png")
    with pytest.raises(InputError, match="time 0 s follows 1 s; times must ascend"):
        view.still(record(tmp_path / "e", times=[1.0, 0.0]), tmp_path / "e.png")
    (tmp_path / "b" / "surface.nc").unlink()
    with pytest.raises(InputError, match=r"no readable surface\.nc"):
        view.still(RunDirectory(tmp_path / "b"), tmp_path / "b.png")
    assert not list(tmp_path.glob("*.png")) and not list(tmp_path.glob("*.gif"))


def test_a_missing_package_is_named(run, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "wavetank.plots.view", None)
    monkeypatch.delattr("wavetank.plots.view")
    assert "is needed: pip install 'wavetank[view]'" in str(command(run.path).exception)
