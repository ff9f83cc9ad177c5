"""Beds from Python and from gridded data, and the nouns that say them; smooth functions are the oracle."""

import resource

import numpy as np
import pytest
import xarray
from conftest import fitted_slope
from mpi4py import MPI
from pydantic import TypeAdapter, ValidationError
from tanks import case_of

from wavetank.base.errors import InputError
from wavetank.base.python_file import load
from wavetank.case import Case, CaseError
from wavetank.case.reading import read_case
from wavetank.case.tank import BeachBed, Bed, FormulaBed, GriddedBed, PythonBed
from wavetank.fem.plane import Plane
from wavetank.mesh import Gridded, Survey, read_bed
from wavetank.simulation.construction import bed_message, build_footprint, build_waves, check_depth

pytestmark = pytest.mark.usefixtures("trusted")

RANDOM = np.random.default_rng(5)
X, Y = RANDOM.uniform(0.0, 4.0, 400), RANDOM.uniform(-1.0, 2.0, 400)


def smooth(x, y):
    """Return a depth [m] without symmetries on the range above."""
    return 1.0 + 0.3 * np.sin(1.3 * x + 0.2) * np.cos(0.9 * y) - 0.05 * x


def slope(bed, x, y):
    """Return grad d by central differences, exact to 1e-10 between the knots of a spline."""
    step = 1e-5
    x, y = np.clip(x, step, 4.0 - step), np.clip(y, step - 1.0, 2.0 - step)
    return np.array([bed(x + step, y) - bed(x - step, y), bed(x, y + step) - bed(x, y - step)]) / (2 * step)


def refused(call, *arguments, **options):
    """Return what a refusal says."""
    with pytest.raises(InputError) as error:
        call(*arguments, **options)
    assert str(error.value).endswith(".")
    return str(error.value)


# ---------------------------------------------------------------- gridded
def errors_of(interpolation, cells, *, across=True):
    """Return the largest errors of depth and slope of a bed of so many cells."""
    x, y = np.linspace(0.0, 4.0, cells + 1), np.linspace(-1.0, 2.0, cells + 1)
    exact = smooth if across else lambda x, y: smooth(x, 0.0 * y)
    axes, d = ({"x": x, "y": y}, smooth(x[:, None], y)) if across else ({"x": x}, smooth(x, 0.0))
    bed = Gridded(axes, d, interpolation=interpolation)
    return np.abs(bed(X, Y) - exact(X, Y)).max(), np.abs(slope(bed, X, Y) - slope(exact, X, Y)).max()


@pytest.mark.parametrize("across", [False, True], ids=["along x", "over x and y"])
@pytest.mark.parametrize(("interpolation", "order"), [("cubic", 4), ("linear", 2)])
def test_depth_and_slope_converge(interpolation, order, across):
    """A spline of degree k is of order k + 1 in the depth and k in the slope."""
    cells = (16, 32, 64, 128)
    depth, slopes = zip(*(errors_of(interpolation, count, across=across) for count in cells), strict=True)
    assert -fitted_slope(cells, depth) == pytest.approx(order, abs=0.3)
    assert -fitted_slope(cells, slopes) == pytest.approx(order - 1, abs=0.3)


def test_data_of_a_cubic_are_the_cubic():
    x = np.array([0.0, 0.3, 1.0, 2.2, 4.0])
    bed = Gridded({"x": x}, 1 + x - 0.3 * x**2 + 0.02 * x**3)
    np.testing.assert_allclose(bed(X, Y), 1 + X - 0.3 * X**2 + 0.02 * X**3, rtol=1e-13)


def test_a_bed_ends_with_its_data():
    bed = Gridded({"x": np.linspace(0.0, 4.0, 5), "y": np.linspace(-1.0, 2.0, 4)}, np.ones((5, 4)), source="bay.nc")
    round_off = np.array([-1e-12, 4.0 + 1e-12])
    np.testing.assert_allclose(bed(round_off, np.array([2.0, -1.0])), 1.0)
    asked = np.array([1.0, 5.0])
    assert refused(bed, asked, 0.0 * asked) == "bay.nc: asked at x = 5 m; its data reach from 0 to 4 m."
    assert refused(bed, 0.0 * asked, asked) == "bay.nc: asked at y = 5 m; its data reach from -1 to 2 m."
    assert "asked at x = nan m" in refused(bed, np.array([np.nan]), np.zeros(1))


@pytest.fixture
def grid():
    """Return the smooth depth on a grid, with attributes as CF's conventions have them."""
    x, y = np.linspace(0.0, 4.0, 21), np.linspace(-1.0, 2.0, 16)
    coordinates = {"x": ("x", x, {"units": "m"}), "y": ("y", y, {"units": "m"})}
    return xarray.Dataset(
        {"depth": (("x", "y"), smooth(x[:, None], y), {"units": "m", "positive": "down"})}, coords=coordinates
    )


def test_netcdf_is_read_whatever_its_order(grid, tmp_path):
    grid.to_netcdf(tmp_path / "bed.nc")
    grid.transpose("y", "x").isel(y=slice(None, None, -1)).to_netcdf(tmp_path / "turned.nc")
    bed = read_bed(tmp_path / "bed.nc")
    np.testing.assert_allclose(bed(X, Y), smooth(X, Y), atol=1e-4)
    np.testing.assert_array_equal(read_bed(tmp_path / "turned.nc")(X, Y), bed(X, Y))


def test_csv_is_read_whatever_its_order(grid, tmp_path):
    table = grid.depth.to_dataframe().reset_index().sample(frac=1.0, random_state=2)
    table[["y", "depth", "x"]].to_csv(tmp_path / "bed.csv", index=False)
    grid.to_netcdf(tmp_path / "bed.nc")
    np.testing.assert_array_equal(read_bed(tmp_path / "bed.csv")(X, Y), read_bed(tmp_path / "bed.nc")(X, Y))


def test_a_profile_holds_for_every_y(tmp_path):
    (tmp_path / "bed.csv").write_text("# measured\nx, depth\n0, 0.4\n8, 0.4\n4, 0.2\n")
    bed = read_bed(tmp_path / "bed.csv", interpolation="linear")
    np.testing.assert_allclose(bed(np.array([1.0, 6.0]), np.array([0.0, 7.0])), [0.35, 0.3])


@pytest.mark.parametrize(("attribute", "key"), [("up", None), ("down", "up"), (None, "up")])
def test_elevations_of_the_bed_are_positive_up(grid, tmp_path, attribute, key):
    grid["elevation"] = -grid.depth.assign_attrs(grid.depth.attrs)
    grid.elevation.attrs = {"positive": attribute} if attribute else {}
    grid.to_netcdf(tmp_path / "bed.nc")
    bed = read_bed(tmp_path / "bed.nc", variable="elevation", positive=key)
    np.testing.assert_array_equal(bed(X, Y), read_bed(tmp_path / "bed.nc", variable="depth")(X, Y))


IN_LINE = "three that are not in line are needed."
NAMES = "its first line must name its columns, e.g. x,y,depth)."


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x,depth\n0,nan\n1,nan\n", "none of its 2 depths is a finite number."),
        ("x,depth\n0,-1\n1,-2\n", "no depth is positive; with positive = 'up' all are."),
        ("x,y,depth\n0,0,1\n1,1,1\n2,2,1\n", f"3 survey points span no triangle; {IN_LINE}"),
        ("x,y,depth\n0,0,1\n1,1,1\n2,,1\n", "values of x and y must be finite."),
        ("x,depth\n0,1\n0,2\n", "cannot be read (two rows have the same x)."),
        ("x,y,depth\n0,0,1\n0,0,2\n", "cannot be read (two rows have the same x and y)."),
        ("x,depth\n0,1\n1,deep\n", "cannot be read (could not convert string to float: 'deep')."),
        ("0,1\n1,2\n", f"cannot be read (it needs a column x, or x and y; it has: 0, 1; {NAMES}"),
        ("x,depth,rock\n0,1,2\n", "one variable must be named, of: depth, rock."),
        ("x\n0\n", "one variable must be named, of: none."),
        ("y,depth\n0,1\n1,1\n", f"cannot be read (it needs a column x, or x and y; it has: y, depth; {NAMES}"),
        ("x,depth\n0,1\n", "1 values of x; linear needs at least 2."),
        ("x,depth\n0,1\n,1\n", "values of x must be finite and differ from one another."),
        ("", "cannot be read (No columns to parse from file)."),
    ],
)
def test_invalid_csv_is_refused(tmp_path, text, sentence):
    refused_text(tmp_path / "bed.csv", text, sentence)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x y depth\n0 0 1\n", "cannot be read (could not convert string to float: 'x')."),
        ("0 0\n1 1\n", "cannot be read (its rows must be x, y and depth, with blanks between; they have 2 columns)."),
        ("", "cannot be read (No columns to parse from file)."),
    ],
)
def test_invalid_xyz_is_refused(tmp_path, text, sentence):
    refused_text(tmp_path / "bed.xyz", text, sentence)


def refused_text(path, text, sentence):
    path.write_text(text)
    assert refused(read_bed, path, interpolation="linear") == f"{path}: {sentence}"


def test_netcdf_is_refused(grid, tmp_path):
    path = tmp_path / "bed.nc"
    assert refused(read_bed, path) == f"{path}: cannot be read (No such file or directory)."
    path.write_text("no NetCDF")
    assert refused(read_bed, path) == f"{path}: cannot be read (NetCDF: Unknown file format)."
    axes = "coordinates of 'depth' must be x, or x and y; they are:"
    elsewhere = "survey points go into a file of CSV or XYZ."
    attributes = lambda **changes: grid.assign(depth=grid.depth.assign_attrs(**changes))  # noqa: E731
    for content, variable, sentence in (
        (grid, "d", "has no variable 'd'; it has: depth."),
        (grid.rename(x="east"), None, f"{axes} east, y; {elsewhere}"),
        (grid.drop_vars("x"), None, f"{axes} x, y; {elsewhere}"),
        (attributes(units="cm"), None, "'depth' is in 'cm'; must be in metres, 'm'."),
        (attributes(positive="north"), None, "'depth' is positive 'north'; must be positive 'down' or 'up'."),
    ):
        path.unlink()
        content.to_netcdf(path)
        assert refused(read_bed, path, variable=variable) == f"{path}: {sentence}"
    assert refused(read_bed, tmp_path / "bed.tif") == (
        f"{tmp_path / 'bed.tif'}: must end in .nc, .csv, .xyz, which is how measured beds are known; "
        "gdal_translate -of XYZ makes one of a raster."
    )


# ---------------------------------------------------------------- gaps
@pytest.mark.parametrize("across", [False, True], ids=["along x", "over x and y"])
def test_gaps_matter_only_where_there_is_water(across):
    """Oracle: a plane, which a bed must keep up to the edge of what is known of it."""
    x, y = np.linspace(0.0, 4.0, 21), np.linspace(-1.0, 2.0, 16)
    axes, places = ({"x": x, "y": y}, np.meshgrid(x, y, indexing="ij")) if across else ({"x": x}, [x, 0.0 * x])

    def plane(x, y):
        return 1.0 - 0.1 * x + (0.2 * y if across else 0.0)

    land = places[0] > 3.0
    bed = Gridded(axes, np.where(land, np.nan, plane(*places)), source="bay.nc")
    wet = X <= 3.0
    np.testing.assert_allclose(bed(X[wet], Y[wet]), plane(X[wet], Y[wet]), rtol=1e-12)
    where = "x = 3.05 m, y = 0.5 m" if across else "x = 3.05 m"
    assert refused(bed, np.array([1.0, 3.05]), np.array([0.5, 0.5])) == (
        f"bay.nc: has no depth at {where}, where there is water; {land.sum()} of {land.size} depths are missing."
    )


@pytest.mark.parametrize("physics", ["nonlinear", "linear"])
def test_minimum_depth_lowers_a_shallow_bed_and_reports_where(physics):
    bed = {"type": "formula", "depth": "1 - 0.4*x", "minimum_depth": 0.2}  # reached at x = 2, dry from x = 2.5
    tank = {"length": 8.0, "depth": 1.0, "bed": bed}
    case = case_of(tank=tank, water={"type": physics}, cells=16)
    assert Case.model_validate(case.model_dump(mode="json")) == case
    waves = build_waves(case, MPI.COMM_SELF)
    np.testing.assert_allclose(waves.bed.still, np.maximum(0.2, 1.0 - 0.4 * waves.plane.x), rtol=1e-12)
    told = bed_message(case, waves)
    assert told.startswith("tank.bed.minimum_depth = 0.2 m applies to ")
    assert float(told.split()[-5]) == pytest.approx(75, abs=3)  # the rest, to a third of a cell
    bed["minimum_depth"] = 0.0
    with pytest.raises(ValidationError, match="minimum_depth\n.*greater than or equal to 0.000001"):
        case_of(tank=tank)


# ---------------------------------------------------------------- survey points
def points(count, *, seed=7):
    """Return places all around those that are asked for, and a little more."""
    random = np.random.default_rng(seed)
    return random.uniform(-0.3, 4.3, count), random.uniform(-1.3, 2.3, count)


def test_triangulated_depths_converge():
    """Piecewise linear ones are of order 2 in the points' distance; so are cubic ones, whose slopes are of order 1."""
    counts, errors = np.array([500, 2000, 8000]), {"linear": [], "cubic": []}
    for interpolation, found in errors.items():
        for count in counts:
            x, y = points(count)
            error = Survey(x, y, smooth(x, y), interpolation=interpolation)(X, Y) - smooth(X, Y)
            found.append(np.sqrt(np.mean(error**2)))
        assert -fitted_slope(np.sqrt(counts), found) == pytest.approx(2, abs=0.3)
    assert (4 * np.array(errors["cubic"]) < errors["linear"]).all()


@pytest.mark.parametrize("suffix", [pytest.param(".csv", marks=pytest.mark.slow), ".xyz"])
def test_sixty_thousand_survey_points_need_little_memory(tmp_path, suffix):
    x, y = points(60_000)
    table = np.column_stack([x + 3e5, y + 5e6, smooth(x, y)])  # as far from the origin as maps are
    names, delimiter = ("x,y,depth", ",") if suffix == ".csv" else ("", " ")
    np.savetxt(tmp_path / f"bed{suffix}", table, fmt="%.6f", delimiter=delimiter, header=names, comments="")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    bed = read_bed(tmp_path / f"bed{suffix}")
    np.testing.assert_allclose(bed(X + 3e5, Y + 5e6), smooth(X, Y), atol=1e-4)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200 * 1024  # KiB; a grid of them has 28 GB


def test_survey_points_may_repeat_or_have_no_depth():
    x, y = points(2000)
    again = [np.concatenate([one, one]) for one in (x, y)]
    d = np.concatenate([smooth(x, y) + 0.1, smooth(x, y) - 0.1])
    lost = np.random.default_rng(1).permutation(d.size // 2)[:200]
    d[lost] = d[lost + 2000] = np.nan
    kept = np.setdiff1d(np.arange(2000), lost)
    expected = Survey(x[kept], y[kept], smooth(x[kept], y[kept]))(X, Y)
    np.testing.assert_allclose(Survey(*again, d)(X, Y), expected, rtol=1e-9)


def test_survey_points_end_level_and_not_far_off(tmp_path):
    (tmp_path / "bed.xyz").write_text("# x y depth\n0 0 1\n10 0.1 1\n0.2 4 2\n10.1 4.1 2\n5 2 1.5\n")
    bed = read_bed(tmp_path / "bed.xyz", interpolation="linear")
    np.testing.assert_allclose(bed(np.array([-0.5, 0.0]), np.array([-0.5, 0.0])), 1.0, rtol=1e-6)
    assert refused(bed, np.array([-4.0]), np.array([0.0])) == (
        f"{tmp_path / 'bed.xyz'}: asked at x = -4 m, y = 0 m; its points end 4 m from there and are 2.82 m apart."
    )
    assert "asked at x = nan m" in refused(bed, np.array([np.nan]), np.zeros(1))


# ---------------------------------------------------------------- Python
@pytest.fixture
def python(tmp_path):
    """Write a Python file and return its path."""

    def write(text):
        path = tmp_path / "bed.py"
        path.write_text(text)
        return path

    return write


def test_a_function_of_a_file_is_a_bed(python):
    path = python("import numpy as np\nTOP = 1.0\n\ndef depth(x, y):\n    x += TOP\n    return np.hypot(x, y)\n")
    x = X.copy()
    np.testing.assert_array_equal(load(path, "depth").at({"x": x, "y": Y}), np.hypot(X + 1.0, Y))
    np.testing.assert_array_equal(x, X)  # the function has arrays of its own


def test_a_file_without_its_function_is_refused(python, tmp_path):
    path = python("def bed(x, y):\n    return x\n")
    assert refused(load, path, "depth") == f"{path}: has no function 'depth'; it has: bed."
    missing = tmp_path / "missing.py"
    absent = f"{missing}: cannot be read (No such file or directory); a Python file is needed."
    assert refused(load, missing, "depth") == absent
    zero = f"{path}, line 2: ZeroDivisionError: division by zero."
    assert refused(load, python("x = 1\ny = 1 / 0\n"), "depth") == zero
    assert refused(load, python("x = 1\nx ="), "depth").startswith(f"{path}, line 2: SyntaxError: invalid syntax")


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("return 1 if x > 1 else 2", ", line 2: ValueError: The truth value of an array with more than one element "),
        ("return 1.0", ": shape () returned; must be that of x and y, (400,)."),
        ("return x[1:]", ": shape (399,) returned; must be that of x and y, (400,)."),
        ("return 'deep'", ": ValueError: could not convert string to float: 'deep'."),
        ("return x / (y > 9)", ": inf at x = "),
    ],
)
def test_what_a_function_returns_is_checked(python, body, sentence):
    path = python(f"def depth(x, y):\n    {body}\n")
    with np.errstate(divide="ignore"):
        assert refused(load(path, "depth").at, {"x": X, "y": Y}).startswith(f"{path}, function 'depth'{sentence}")


# ---------------------------------------------------------------- nouns
def test_nouns_build_their_beds_and_survive_json(tmp_path, python):
    (tmp_path / "bed.csv").write_text("x,rock,mud\n0,-1,-2\n4,-3,-4\n")
    path = python("def bed(x, y):\n    return 1.0 + x\n")
    elevations = GriddedBed(file=str(tmp_path / "bed.csv"), variable="mud", interpolation="linear", positive="up")
    nouns = [
        (FormulaBed(depth="a + s*x", where={"a": 1.0, "s": "a/2"}), 1.0 + 0.5 * X),
        (PythonBed(file=str(path), function="bed"), 1.0 + X),
        (elevations, 2.0 + 0.5 * X),
        (BeachBed(start=1.5, slope=0.5, minimum_depth=0.3), np.maximum(1.0 - 0.5 * np.maximum(X - 1.5, 0.0), 0.3)),
    ]
    union = TypeAdapter(Bed)
    for noun, d in nouns:
        np.testing.assert_allclose(noun.build(1.0)(X, Y), d, rtol=1e-14)
        assert union.validate_python(noun.model_dump(mode="json")) == noun
        assert union.validate_json(noun.model_dump_json()) == noun


@pytest.mark.parametrize(
    ("beach", "said"),
    [
        ("start = 5.0\nslope = 0.1", "tank.bed.start = 5.0: must be below the tank's length, 4 m"),
        ("start = 2.0\nslope = 0.5", "tank.bed.slope = 0.5: must be below 0.5 for a tank that is wet to its end"),
        ("start = 2.0\nslope = 0.5\nminimum_depth = 0.1", ""),
    ],
)
def test_a_beach_must_be_in_the_tank_and_below_the_water(tmp_path, beach, said):
    path = tmp_path / "case.toml"
    path.write_text(f'run.duration = 1.0\n[tank]\nlength = 4.0\ndepth = 1.0\n[tank.bed]\ntype = "beach"\n{beach}\n')
    if not said:
        assert read_case(path).tank.bed.build(1.0)(np.array([2.2, 4.0]), np.zeros(2)) == pytest.approx([0.9, 0.1])
        return
    assert said in refused(read_case, path)


BASIN = {"type": "basin", "layout": {"type": "rectangle", "length": 8.0, "width": 4.0, "origin": [2.0, 0.0]}}
DEPTHS = [  # tank, wall, bed, depth, what is said of it
    ({"length": 8.0}, "piston", "0.4 - 0.02 * x", 0.8, "must be the bed's depth at the paddle, 0.4 m, to 1 %"),
    ({"length": 8.0}, "piston", "0.8", 0.4, "must be the bed's depth at the paddle, 0.8 m, to 1 %"),
    ({"length": 8.0}, "piston", "0.403 - 0.02 * x", 0.4, ""),  # as a survey may find it
    (BASIN, "piston", "0.4 - 0.02 * x + 0.01 * y", 0.5, "must be the bed's depth at the paddle, 0.36 to 0.4 m, to 1 %"),
    (BASIN, "piston", "0.4 - 0.02 * x + 0.01 * y", 0.38, ""),
    (BASIN, "fixed", "0.4 - 0.02 * x", 0.28, ""),
    (BASIN, "fixed", "0.4 - 0.02 * x", 0.5, "must be a depth of the bed, 0.2 to 0.36 m, to 1 %"),
]


def depth_refused(tank, wall, bed, depth, comm):
    """Return what is said of a depth over a bed by formula; nothing of one that is taken."""
    wall = {"type": wall} | ({"motion": {"type": "at-rest"}} if wall == "piston" else {})
    tank = tank | {"depth": depth, "bed": {"type": "formula", "depth": bed}}
    case = case_of(wall, tank=tank, numerics={"cells": None})
    footprint = build_footprint(case, comm)
    try:
        check_depth(case, footprint, Plane(footprint.mesh, 2, footprint.chart))
    except CaseError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(("tank", "wall", "bed", "depth", "said"), DEPTHS)
def test_depth_that_differs_from_the_bed_at_the_wavemaker_is_refused(tank, wall, bed, depth, said):
    found = depth_refused(tank, wall, bed, depth, MPI.COMM_SELF)
    assert found == (said and f"tank.depth = {depth}: {said}.")


def refused_together():
    return depth_refused(*DEPTHS[0][:4], MPI.COMM_WORLD)


def test_a_depth_is_refused_by_all_ranks_alike(on_ranks):
    """Only one of them has the paddle."""
    assert set(on_ranks(refused_together)) == {refused_together()} == {f"tank.depth = 0.8: {DEPTHS[0][-1]}."}
