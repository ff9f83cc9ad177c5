"""Views and maps of basins: oracles are the waves, walls and beds that were put in, and where a camera shows them."""

from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.image import imread
from records import gauge_array, write_run

from wavetank.base.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import VtkCells, VtuSeries
from wavetank.plots import basin, view
from wavetank.plots.figures import draw_run
from wavetank.plots.surfaces import Extremes, basin_surface, wave_history

LENGTH, WIDTH, DEPTH, HEIGHT_OF_WAVES = 8.0, 4.0, 0.5, 0.1  # m
PERIOD, STEPS = 1.6, 20  # snapshots of one period [s]
WAVE, REACH, STROKE = 2.0, 2.0, 0.05  # m
TIMES = PERIOD / STEPS * np.arange(2 * STEPS + 1)
SHOAL = (5.0, 2.0)


class Rank:
    """What a series of fields knows of MPI; the ranks here write one after the other."""

    def __init__(self, rank, size):
        self.rank, self.size = rank, size

    def allgather(self, value):
        return [value]

    def Ibarrier(self):
        return SimpleNamespace(Test=lambda: True)


def travelling(x, y, t):
    return HEIGHT_OF_WAVES / 2 * np.cos(2 * np.pi * (x / WAVE - t / PERIOD))


def flat(x, y):
    return np.full_like(x, DEPTH)


def shoal(x, y):
    return DEPTH - 0.3 * np.exp(-((x - SHOAL[0]) ** 2) - (y - SHOAL[1]) ** 2)


def still(y, t):
    return 0.0 * y


def swinging(y, t):
    """Return the place of a paddle that is turned about its middle as it moves."""
    return STROKE * np.sin(2 * np.pi * t / PERIOD) * (1 + (y - WIDTH / 2) / WIDTH)


def everywhere(x, y):
    return x > 0


def mesh(kept=everywhere, triangles=False):
    """Return places, shape (N, 2), and pieces of a lattice, of which cells with middles (x, y) are kept."""
    x, y = np.linspace(0.0, LENGTH, 49), np.linspace(0.0, WIDTH, 25)
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    first = (np.arange(48)[:, None] * 25 + np.arange(24)).ravel()
    pieces = np.stack([first, first + 25, first + 26, first + 1], axis=1)
    pieces = pieces[kept(*places[pieces].mean(axis=1).T)]
    return places, np.concatenate([pieces[:, [0, 1, 2]], pieces[:, [0, 2, 3]]]) if triangles else pieces


def record(path, *, depth=flat, paddle=still, far=still, damping=None, ranks=1, times=TIMES, motion=None, **cells):
    """Write a run directory of a basin with a depth(x, y), paddles' places(y, t) [m] and a damping(x, y) [1/s]."""
    tank = {"type": "basin", "depth": DEPTH, "layout": {"type": "rectangle", "length": LENGTH, "width": WIDTH}}
    places, pieces = mesh(**cells)
    mast = gauge_array(["mast"], [3.0], [1.0], times[:1], [[0.0] * len(times[:1])])
    energy = {"energy.csv": (["t [s]", "kinetic [m^5/s^2]"], np.ones((len(times[:1]), 2)))}
    write_run(path, {"title": "A basin", "tank": tank, "wall": {"motion": motion}}, gauges=mast, tables=energy)
    for rank in reversed(range(ranks)):  # the first one tells of all
        series = VtuSeries(path, "surface", comm=Rank(rank, ranks))
        own = pieces[(places[pieces].mean(axis=1)[:, 0] * ranks // LENGTH).astype(int) == rank]
        points, corners = np.unique(own, return_inverse=True)
        flat_cells = VtkCells.flat(corners.reshape(own.shape).astype(np.int32))
        x, y = places[points].T
        for t in times:
            moved = x + np.maximum(0.0, 1 - x / REACH) * paddle(y, t)
            moved -= np.maximum(0.0, 1 - (LENGTH - x) / REACH) * far(y, t)
            eta = travelling(moved, y, t)
            arrays = {"elevation": eta, "surface potential": 0 * eta, "depth": depth(x, y)}
            arrays |= {} if damping is None else {"damping rate": damping(x, y)}
            series.append(float(t), np.column_stack([moved, y, eta]), cells=flat_cells, arrays=arrays)
    return RunDirectory(path)


def around(x, y):
    """Keep the cells around a square island, 4 m < x < 5 m and 1 m < y < 2 m."""
    return ~((abs(x - 4.5) < 0.5) & (abs(y - 1.5) < 0.5))


# ---------------------------------------------------------------- the surface over time
@pytest.mark.parametrize("triangles", [False, True])
def test_basin_surface_is_interpolated_between_snapshots(tmp_path, triangles):
    surface = basin_surface(record(tmp_path / "run", paddle=swinging, triangles=triangles))
    for t in (TIMES[0] + 0.03, TIMES[20] + 0.05, TIMES[-1] - 0.01):
        x, y, eta = surface.at(t).T
        # cubic through four: at most (omega dt)^4 / 24 of each, 4e-4, at the ends; a straight line's is 1.2e-2
        assert eta == pytest.approx(travelling(x, y, t), abs=5e-4 * HEIGHT_OF_WAVES)
        came_to = swinging(np.unique(y.round(9)), t)
        assert x[np.abs(surface.first[:, 0]) < 1e-9] == pytest.approx(came_to, abs=5e-4 * STROKE)


def test_pieces_of_two_and_three_ranks_are_one_surface(tmp_path):
    def told(ranks):
        parts = {"paddle": swinging, "depth": shoal, "kept": around, "times": TIMES[:12]}
        surface = basin_surface(record(tmp_path / str(ranks), ranks=ranks, **parts))
        waves = wave_history(surface)
        place = surface.first[:, :2].round(9)
        order = np.lexsort(place.T)
        columns = [surface.at(0.7), surface.depth, waves.displacement, waves.high, waves.crest]
        sizes = [waves.usual, waves.slope, waves.crest_time, len(surface.pieces)]
        moving = surface.rim[surface.moving(waves.displacement)]
        return (
            np.column_stack(columns)[order],
            sizes,
            *(sorted(map(tuple, place[edges].reshape(-1, 4))) for edges in (surface.rim, moving)),
        )

    alone = told(1)
    for other in map(told, (2, 3)):
        assert other[0] == pytest.approx(alone[0], abs=1e-12)
        assert other[1] == pytest.approx(alone[1], rel=1e-12)
        assert other[2:] == alone[2:]


def test_rim_is_all_walls_and_paddles_are_those_that_move_across_themselves(tmp_path):
    surface = basin_surface(record(tmp_path / "run", paddle=swinging, far=swinging, kept=around, times=TIMES[:8]))
    assert len(surface.rim) == 2 * (48 + 24) + 4 * 6
    moving = surface.first[surface.rim[surface.moving(wave_history(surface).displacement)]]
    ends = {x: np.sort(np.unique(moving[np.abs(moving[..., 0] - x) < 1e-9][:, 1].round(9))) for x in (0.0, LENGTH)}
    assert all(y == pytest.approx(np.linspace(0.0, WIDTH, 25)) for y in ends.values()) and len(moving) == 48
    still = basin_surface(record(tmp_path / "still", times=TIMES[:2]))
    assert not still.moving(wave_history(still).displacement).any()


def test_view_shows_bed_contours_sponge_and_paddles(tmp_path):
    """Oracles: the depth of the shoal, the root of the damping rate, the paddle's stroke."""

    def end(x, y):
        return 3.0 * np.clip((x - 5.0) / 3.0, 0.0, 1.0) ** 2

    picture = view.View(record(tmp_path / "run", depth=shoal, paddle=swinging, damping=end), size=(320, 180))
    picture.draw(PERIOD / 4)
    mesh = {name: picture.plotter.actors[name].mapper.dataset for name in ("sides", "paddle", "contours", "sponge")}
    points = {name: one.points / (1.0, 1.0, picture.exaggeration) for name, one in mesh.items()}
    x, y, z = points["sides"].T
    foot = (z < -0.1) & (x > REACH)
    assert z[foot] == pytest.approx(-shoal(x[foot], y[foot]), abs=1e-6)
    x, y, _ = points["contours"].T
    # the lattice's linear interpolation of the bed: h^2 / 8 |d''|, with h = 1/6 m and |d''| < 1.2 / m
    assert np.abs(shoal(x, y)[:, None] - (0.25, 0.3, 0.35, 0.4, 0.45)).min(axis=1).max() < 0.005
    x, y, _ = points["sponge"].T
    cover = mesh["sponge"]["colour"][:, 3] / view.OPACITY
    assert cover == pytest.approx(np.sqrt(end(x, y) / 3.0), abs=0.01)
    x, y, _ = points["paddle"].T
    assert x == pytest.approx(swinging(y, PERIOD / 4), abs=1e-6)
    note = picture.plotter.actors["note"].GetText(0)
    assert note.endswith("lines of still-water depth 0.25, 0.3, 0.35, 0.4, 0.45 m, sponge: violet")
    picture.close()


def test_extremes_include_crests_between_snapshots():
    t = PERIOD / 9 * np.arange(20)  # nine snapshots a period
    phase = np.linspace(0.0, 2 * np.pi, 200)
    extremes = Extremes(200)
    for one in t:
        extremes.add(float(one), np.cos(2 * np.pi * one / PERIOD + phase))
    snapshots = np.cos(2 * np.pi * t[:, None] / PERIOD + phase).max(axis=0)
    assert snapshots.min() == pytest.approx(np.cos(np.pi / 9), abs=1e-3)  # 6 % too low
    # halfway between two, (cos 20, cos 20, cos 60 degrees) have a parabola of height 0.9946
    assert extremes.high == pytest.approx(1.0, abs=0.0055)
    assert extremes.low == pytest.approx(-1.0, abs=0.0055)


# ---------------------------------------------------------------- maps
def words(run, tmp_path):
    with rc_context({"svg.fonttype": "none"}):
        return basin.basin_figure(run, tmp_path / "map.svg").read_text()


def test_maps_name_quantities_times_and_places(tmp_path):
    parts = {"depth": shoal, "paddle": swinging, "damping": lambda x, y: x - 0.0, "times": TIMES[:6]}
    text = words(record(tmp_path / "run", **parts), tmp_path)
    titles = ("A basin", "at the highest crest of the snapshots, t = ", "elevation of the snapshots")
    for word in (*titles, "elevation [cm]", ">x [m]<", ">y [m]<", ">mast<", ">sponge<", ">0.25 m<", ">0.45 m<"):
        assert word in text
    assert "crest minus trough" not in text  # no period is known


def test_wave_heights_are_mapped_when_the_run_is_long_enough(tmp_path):
    regular = {"type": "sinusoid", "period": PERIOD}
    times = PERIOD / 8 * np.arange(6 * 8 + 1)
    run = record(tmp_path / "run", motion=regular, times=times)
    (heights,) = basin._wave_heights(run, basin_surface(run))
    assert heights.values == pytest.approx(HEIGHT_OF_WAVES, rel=0.01)  # eight snapshots a period
    assert heights.title == "wave height from t = 4.80 to 9.60 s"
    assert "crest minus trough [cm]" in words(run, tmp_path)
    for name, few in (("early", times[:-1]), ("seldom", times[::4])):
        run = record(tmp_path / name, motion=regular, times=few)
        assert not basin._wave_heights(run, basin_surface(run))


# ---------------------------------------------------------------- the commands
def test_a_basin_is_drawn_after_its_run_unless_it_was_killed_early(tmp_path):
    for count in (0, 1):
        assert draw_run(record(tmp_path / str(count), times=TIMES[:count])) == []
    pictures = draw_run(record(tmp_path / "run", paddle=swinging, times=TIMES[:4]))
    assert [picture.name for picture in pictures] == ["surface.png"]  # gauges and energy have one row


TURNED = np.pi / 6
LEANING = """
gauges = [{x = 0.5, y = 0.5}]
run.duration = 0.4
tank = {type = "basin", depth = 0.5, layout = {type = "file", file = "turned.msh"}}
wall = {type = "piston", reach = 1.0, motion = {type = "sinusoid", paddle_amplitude = 0.05, period = 0.8, ramp = 0.0}}
numerics = {order = 2, vertical_order = 2, dt = 0.05, tolerance = 1e-10}
output.surface_every = 0.05
"""


def write_turned_mesh(path):
    """Write a mesh of 2 m by 1 m in eight squares, turned by TURNED about its corner at (0, 0)."""
    x, y = (one.ravel() for one in np.meshgrid(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3), indexing="ij"))
    c, s = np.cos(TURNED), np.sin(TURNED)
    first = (3 * np.arange(4)[:, None] + np.arange(2)).ravel()
    walls = [*((n, n + 3) for side in (0, 2) for n in range(side, side + 10, 3)), (12, 13), (13, 14)]
    cells = [("line", [(0, 1), (1, 2), *walls]), ("quad", np.stack([first, first + 3, first + 4, first + 1], axis=1))]
    groups = [np.array([1, 1, *(2 for _ in walls)]), np.full(8, 3)]
    meshio.Mesh(
        np.column_stack([c * x - s * y, s * x + c * y, 0 * x]),
        cells,
        cell_data={"gmsh:physical": groups, "gmsh:geometrical": groups},
        field_data={"paddle": np.array([1, 1]), "wall": np.array([2, 1]), "water": np.array([3, 2])},
    ).write(path, file_format="gmsh22", binary=False)


def test_view_draws_a_run_resumed_on_other_ranks_with_a_paddle_at_an_angle(wavetank, tmp_path, monkeypatch):
    """Oracles: the same run on one rank without interruption; the turned line of the paddle and its motion."""
    monkeypatch.setitem(view.FILMS, ".gif", (2.0, (160, 160)))
    write_turned_mesh(tmp_path / "turned.msh")
    (tmp_path / "case.toml").write_text(LEANING)
    case, one, part = (str(tmp_path / name) for name in ("case.toml", "one", "part"))
    assert wavetank("run", case, "--no-plots", "--out", one).returncode == 0
    half = ("--set", "run.duration=0.2", "--no-plots", "--out", part)
    assert wavetank("run", case, *half, ranks=2).returncode == 0
    assert wavetank("resume", part, "--extend", "0.2", "--no-plots").returncode == 0
    said = wavetank("view", part, "--diagram", "--time", "0.1", "--film", f"{tmp_path}/film.gif", "--size", "320x180")
    assert said.returncode == 0, said
    assert imread(tmp_path / "part" / "view.png").shape[:2] == (180, 320)
    assert imread(tmp_path / "part" / "surface.png")[..., :3].std() > 0.05
    assert (tmp_path / "film.gif").stat().st_size > 10_000
    whole, resumed = (basin_surface(RunDirectory(name)) for name in (one, part))
    assert whole.times == pytest.approx(resumed.times) and len(whole.times) == 9
    order, reordered = (np.lexsort(np.round(each.first[:, :2], 6).T) for each in (whole, resumed))
    for number in range(9):
        np.testing.assert_allclose(resumed.snapshot(number)[reordered], whole.snapshot(number)[order], atol=1e-9)
    paddle = resumed.rim[resumed.moving(wave_history(resumed).displacement)]
    c, s = np.cos(TURNED), np.sin(TURNED)
    x, y = resumed.snapshot(4)[np.unique(paddle), :2].T  # t = 0.2 s, a quarter of the period
    assert len(x) == 5 and x * c + y * s == pytest.approx(0.05, abs=1e-6)


def test_basins_that_cannot_be_viewed_are_refused(tmp_path):
    run = record(tmp_path / "run", times=TIMES[:3])

    def refused(sentence, draw, *arguments, **options):
        with pytest.raises(InputError, match=sentence):
            draw(*arguments, tmp_path / "a.png", **options)
        assert not (tmp_path / "a.png").exists()

    refused("allowed is 0 to 0.16 s", view.still, run, t=1.0)
    one = record(tmp_path / "one", times=TIMES[:1])
    refused("1 snapshots of the surface received; at least 2", basin.basin_figure, one)
    (run.path / "fields" / "surface_000001.pvtu").unlink()
    refused(r"surface_000001\.pvtu: is missing", view.still, run)
    (run.path / "surface.pvd").unlink()
    refused(r"no readable surface\.pvd", view.still, run)
