"""Case files: allowed values, defaults, and messages for everything else."""

import ast
import pickle
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ranks import CHECKOUT

from wavetank.base.errors import InputError
from wavetank.base.schemes import SCHEMES
from wavetank.case import Case, Gauge, Numerics, PistonWall, RunControl, SinusoidMotion, SliceTank
from wavetank.case.reading import read_case
from wavetank.case.wall import AnyWall, BaseWall, ShapedWall
from wavetank.cli import main
from wavetank.integrators import Simpson4, registered
from wavetank.planning.cost import CONSTANTS, KINDS

CASES = CHECKOUT / "cases"

GROUP = """\
title = "a group"
gauges = [
    {x = 4.0},
    {name = "focus", x = 10.0},
]

[tank]
length = 24.0
depth = 1.0

[wall]
type = "piston"

[wall.motion]
type = "focused"
linear_crest = 0.1
focus_x = 10.0
focus_time = 20.0
spectrum = {type = "jonswap", peak_frequency = 0.65}
highest_frequency = 1.2

[run]
duration = 24.0
"""


@pytest.fixture
def write_case(tmp_path):
    """Write a case and return its path."""

    def write(text=GROUP):
        path = tmp_path / "case.toml"
        path.write_text(text)
        return path

    return write


def refused(path, *overrides):
    """Return what the refusal of a case says."""
    with pytest.raises(InputError) as error:
        read_case(path, overrides)
    return str(error.value)


# ---------------------------------------------------------------- what is allowed
def test_case_file_equals_case_built_in_python(write_case):
    text = """
        gauges = [1.0, {x = 2.0}, {name = "end", x = 5.0}]
        tank = {length = 5.0, depth = 0.5}
        wall = {type = "piston", motion = {type = "sinusoid", paddle_amplitude = 0.01, period = 1.5}}
        run = {duration = 3}
        numerics = {cell_size = 0.25, integrator = "stormer-verlet"}
    """
    assert read_case(write_case(text)) == Case(
        gauges=(Gauge(name="1", x=1.0), Gauge(name="2", x=2.0), Gauge(name="end", x=5.0)),
        tank=SliceTank(length=5.0, depth=0.5),
        wall=PistonWall(motion=SinusoidMotion(paddle_amplitude=0.01, period=1.5)),
        run=RunControl(duration=3.0),
        numerics=Numerics(cell_size=0.25, integrator="stormer-verlet"),
    )


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_case_equals_its_dump(path):
    try:
        case = read_case(path)
    except InputError as missing:
        if "wavetank data fetch" not in str(missing) and "set WAVETANK_DATA" not in str(missing):
            raise
        pytest.skip(str(missing))
    assert Case.model_validate(case.model_dump(mode="json")) == case
    assert Case.model_validate_json(case.model_dump_json()) == case
    assert case.title
    assert f"[`{path.name}`]({path.name})" in (CASES / "README.md").read_text(encoding="utf-8")


def test_defaults_are_resolved_in_properties():
    case = Case(tank=SliceTank(length=20.0, depth=1.0), run=RunControl(duration=40.0))
    assert (case.cells, case.ends[0].reach, case.motion().moves) == (100, np.inf, False)
    assert case.surface_every == pytest.approx(0.5 * 9.81**-0.5)  # short against any wave period
    assert case.model_copy(update={"run": RunControl(duration=10.0)}).surface_every == 0.05  # 200 of them at least
    types = case.wall.type, case.initial.type, case.tank.type
    assert types == ("fixed", "still-water", "slice") and case.tank.gravity == 9.81
    piston = PistonWall(motion=SinusoidMotion(paddle_amplitude=0.01, period=1.0))
    for length, reach in ((20.0, 10.0), (3.0, 3.0)):
        assert Case(tank=SliceTank(length=length, depth=1.0), run=case.run, wall=piston).ends[0].reach == reach


@given(st.floats(0.1, 100.0), st.floats(0.1, 10.0), st.floats(0.01, 10.0))
def test_cells_divide_the_length(length, depth, size):
    """Into the nearest number of cells, at least one."""
    tank = SliceTank(length=length, depth=depth)
    assert Numerics(cells=7).cells_in(tank) == 7
    for numerics, wanted in ((Numerics(), depth / 5), (Numerics(cell_size=size), size)):
        cells = numerics.cells_in(tank)
        assert cells == 1 or (cells > 1 and abs(length / wanted - cells) <= 0.5 * (1 + 1e-12))


RECORD = 'wall.motion={{type="recorded", {}="paddle.dat"}}'


@pytest.mark.parametrize(
    ("key", "expected"), [("position", 0.01 * np.sin(7.77)), ("velocity", 0.01 * (1 - np.cos(7.77)))]
)
def test_record_path_is_relative_to_the_case(write_case, tmp_path, key, expected):
    """Oracle: the recorded function or its integral; the spline's error is of the order of (0.1)^4 / 384."""
    t = np.linspace(0.0, 30.0, 301)
    np.savetxt(tmp_path / "paddle.dat", np.column_stack([t, 0.01 * np.sin(t)]), fmt="%.17g")
    path = write_case()
    case = read_case(path, [RECORD.format(key)])
    assert case.motion().position(7.77) == pytest.approx(expected, abs=1e-8)
    assert Case.model_validate(case.model_dump(mode="json")).motion().position(7.77) == case.motion().position(7.77)
    said = refused(path, RECORD.format(key), "run.duration=31")
    assert said == f"{path}, overridden: run.duration = 31.0: must be at most 30 s, where the recorded motion ends."


def test_recorded_motion_reads_a_named_column_with_gain(write_case, tmp_path):
    rows = "".join(f"{t},{0.01 * t},7\n" for t in np.linspace(0.0, 30.0, 301))
    (tmp_path / "paddle.csv").write_text(f"t,flap,gauge\n{rows}")

    def changes(column):
        return f'wall.motion={{type="recorded", position="paddle.csv", gain=-2.0, column={column}}}', "run.duration=20"

    assert read_case(write_case(), changes('"flap"')).motion().position(7.77) == pytest.approx(-0.1554)
    slow = read_case(write_case(), changes('"flap", highest_frequency=1.9')).motion()
    assert slow.velocity(np.linspace(1.0, 29.0, 9)) == pytest.approx(-0.02, rel=1e-9)
    for column, said in (
        ('"flap", highest_frequency=2.4', "2.4 Hz received; must be at most 1.9"),
        ('"piston"', "paddle.csv: has no column 'piston'; its columns are t, flap, gauge"),
    ):
        assert said in refused(write_case(), *changes(column))


@pytest.mark.parametrize("key", ["position", "velocity"])
def test_gap_in_recorded_motion_is_refused(write_case, tmp_path, key, capsys):
    """Of a period of 2 s, rows every 0.01 s: a gap of a quarter period and random times are allowed, 4 s are not."""
    t = np.arange(3001) / 100
    random = np.random.default_rng(7).uniform(size=t.size) < 0.2
    random[-1] = True
    case, changes = write_case(), [RECORD.format(key), "run.duration=20"]

    def write(without):
        rows = np.column_stack([t, 0.03 * np.sin(np.pi * t)])[~without]
        np.savetxt(tmp_path / "paddle.dat", rows, fmt="%.9g")

    for without in ((t > 10) & (t < 10.49), ~random):
        write(without)
        assert read_case(case, changes).motion().duration == 30.0
    write((t > 10) & (t < 14))
    assert main(["plan", str(case), "--set", changes[0], "--set", changes[1]]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "paddle.dat, line 1002: gap of 4 s after t = 10 s; allowed are 0.5 s" in said
    assert f"wall.motion.{key} = " in said and said.endswith("(median interval 0.01 s, period about 2 s): add rows.")


def test_case_with_cached_motion_is_picklable(write_case):
    """A formula's motion has functions, which cannot be pickled."""
    case = read_case(write_case(), ['wall.motion={type="formula", position="0.01*sin(t)"}'])
    assert case.motion().position(1.0) == pickle.loads(pickle.dumps(case)).motion().position(1.0)


def test_every_integrator_with_costs_is_registered():
    for file in (CHECKOUT / "wavetank" / "integrators").glob("*.py"):
        for scheme in (one for one in ast.walk(ast.parse(file.read_text())) if isinstance(one, ast.ClassDef)):
            if any(ast.unparse(line).startswith("costs") for line in scheme.body):
                entry = file.stem, scheme.name
                assert entry in SCHEMES.values(), f"{entry} is missing in wavetank/base/schemes.py"


def test_every_shape_of_a_wall_is_one_that_a_case_can_name():
    """Also one that derives from another wall, which would be built as a piston."""
    kinds, missing = [*BaseWall.__subclasses__()], []
    while kinds:
        kind = kinds.pop()
        kinds += kind.__subclasses__()
        missing += [kind.__name__] if "type" in kind.model_fields and kind not in get_args(AnyWall) else []
        assert issubclass(kind, ShapedWall) or kind.wavemaker is BaseWall.wavemaker, f"{kind.__name__}: no ShapedWall"
    assert not missing, f"{missing}: missing in AnyWall of wavetank/case/wall.py"


def test_integrators_of_a_case_have_what_plans_need():
    assert {*CONSTANTS} == {f"{kind} {name}" for kind in KINDS for name in SCHEMES}
    named = ("name", "order", "stability_limit", "frequency_error", "nodes", "start", "step", "solvable")
    scheme = type("Mine", (), {name: getattr(Simpson4, name) for name in named})
    with pytest.raises(TypeError, match=r"^Mine has no costs; a case needs them \(docs/extend.md\)\.$"):
        registered({"mine": scheme})
    scheme.costs = Simpson4.costs
    assert registered({"simpson-4": scheme}) == {"simpson-4": scheme}
    with pytest.raises(TypeError, match=r"^Mine.name = 'simpson-4': must be 'mine', as in SCHEMES.$"):
        registered({"mine": scheme})


def test_dump_contains_data_references(write_case, tmp_path, monkeypatch):
    monkeypatch.setenv("WAVETANK_DATA", str(tmp_path))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "x.dat").write_text("".join(f"{t} 0.0\n" for t in range(40)))
    case = read_case(write_case(), ['wall.motion={type="recorded", position="data:mine/x.dat"}'])
    assert case.model_dump(mode="json")["wall"]["motion"]["position"] == "data:mine/x.dat"
    assert case.motion().position(3.0) == 0.0


def test_overrides_accept_toml_values_and_bare_text_at_any_depth(write_case):
    overrides = ["numerics.dt=0.01", "numerics.integrator=stormer-verlet", "gauges.1.x=12", "title=two words"]
    spectrum = 'wall.motion.spectrum={type="gaussian", peak_frequency=0.6, bandwidth=0.1}'
    case = read_case(write_case(), [*overrides, "tank.length=30.0", spectrum])
    assert (case.numerics.dt, case.numerics.integrator, case.title) == (0.01, "stormer-verlet", "two words")
    assert case.gauges == (Gauge(name="1", x=4.0), Gauge(name="focus", x=12.0))
    assert (case.tank.length, case.wall.motion.spectrum.bandwidth) == (30.0, 0.1)


# ---------------------------------------------------------------- what is not
BASIN = """\
tank = {type = "basin", depth = 0.5, layout = {type = "rectangle", length = 12.0, width = 10.0}}
run.duration = 24.0
wall.type = "segmented-piston"
"""
OBLIQUE = BASIN + 'wall.motion = {type = "oblique-wave", wave_amplitude = 0.02, period = 1.3, angle = 30.0}\n'
FOCUS = (
    BASIN
    + """\
[wall.motion]
type = "directional-focus"
linear_crest = 0.05
focus_x = 6.0
focus_y = 5.0
focus_time = 20.0
spectrum = {type = "jonswap", peak_frequency = 0.8}
highest_frequency = 1.2
components = 48
"""
)
WAVES = """\
tank = {length = 20.0, depth = 1.0}
run.duration = 20.0
wall.type = "piston"
wall.motion = {type = "regular", height = 0.04, period = 2.0}
"""
SEA = 'wall.motion={type="irregular", significant_height=0.05, spectrum={type="tma", peak_period=2.0}}'
RING = """\
tank = {type = "ring", length = 12.0, depth = 0.8}
run.duration = 0.5
initial = {type = "irregular", significant_height = 0.04, spectrum = {type = "jonswap", peak_period = 1.6}}
"""
MEETING = 'initial={type="focused", linear_crest=0.05, x=4.0, spectrum={type="jonswap", peak_period=1.6}}'
SOLITARY = 'wall.motion={type="solitary-wave", height=0.2, crest_time=2.0}'
FORMULA = 'tank={type="ring", length=9, depth=1, bed={type="formula"}}'
SECOND, LINEAR = "wall.motion.generation=second-order", 'wall.motion.generation = "second-order": must be linear: '
GAUGE = "[[gauges]]\nx = 4\n"
REFUSED = [  # case, overrides, a part of the sentence
    (GROUP, "tank.depth=-1", "tank.depth = -1: must be greater than or equal to 1e-06 (still-water depth d [m];"),
    (GROUP, "tank.depth=inf", "tank.depth = Infinity: must be a finite number (still-water depth d [m];"),
    (GROUP, 'tank.depth="1.0"', 'tank.depth = "1.0": must be a valid number (still-water depth d [m];'),
    (GROUP, "windows=[{name='a', start=[1, 0], end=[1, 0], columns=3, every=0.1}]", "another place than the start"),
    (GROUP, "tank.lenght=3", "= 3: is an unknown key; did you mean 'length'? allowed are: bed, density, depth, "),
    (GROUP, "tank=3", "tank = 3: must be a table; allowed are: bed, density, depth, gravity, layout, length, type"),
    (GROUP, "tank.type=pond", 'tank.type = "pond": is an unknown type; allowed are: slice, ring, basin'),
    (GROUP, "wall.type=crane", 'wall.type = "crane": is an unknown type; allowed are: fixed, piston, flap, profile'),
    (GROUP, "wall={reach=3}", "wall.type: is missing; allowed are: fixed, piston"),
    (GROUP, "tank.sponge={length=2.0}", "tank.sponge = "),
    (GROUP, "gauge=[{x=1.0}]", "unknown key; did you mean 'gauges'? allowed are: far_wall, gauge_lines, "),
    (GROUP, "wall={type='profile',shape='1 + z/d'}", "where, z; what it stands for is said by where = { d = ... }"),
    (GROUP, "wall.absorb=true", "wall.absorb = true: must be a table; allowed are: damping, longest, mass, period, "),
    (
        GROUP,
        "wall.absorb={type='active', period=2.0}",
        "absorb.period = 2.0: is an unknown key; allowed are: longest, ",
    ),
    (GROUP, "numerics.phase=0.1", "numerics.phase = 0.1: is an unknown key"),
    (GROUP, "wall.motion={type='oblique-wave'}", 'wall.motion.type = "oblique-wave": is an unknown type;'),
    (GROUP, "wall={type='segmented-piston', motion={type='at-rest'}}", "an unknown type; allowed are: oblique-wave, "),
    (GROUP, "wall.type=fixed", "wall.motion = {"),
    (GROUP, "run.dt=0.01", "allowed are: checkpoint_every, duration, on_breaking."),
    (
        GROUP,
        'wall.motion={type="sinusoid", paddle_amplitude=10, period=2}',
        "3/4 of its reach, which is 10 m by default",
    ),
    (GROUP, "wall.reach=0.01", "wall.reach = 0.01: must be more than 0.06144 m, 4/3 of"),
    (GROUP, "wall.motion.type=sinusiod", "\"sinusiod\": is an unknown type; did you mean 'sinusoid'?"),
    (GROUP, "wall.motion.focus_time=9", "wall.motion.focus_time = 9.0: must be at least"),
    (GROUP, "wall.motion.components=9", "components = 9: must be 22 or more: so few repeat the waves every 9.143 s"),
    (GROUP, "wall.motion.lowest_frequency=0.7", "spectrum: must have its peak, 0.65 Hz, within the components'"),
    (GROUP, "wall.motion.spectrum={type='jonswap'}", "one of the keys 'peak_frequency' and 'peak_period'"),
    (GROUP, 'wall.motion={type="recorded"}', "must have exactly one of the keys 'position' and 'velocity'"),
    (GROUP, 'wall.motion={type="sinusoid", paddle_amplitude=0.1}', "motion.period: is missing; needed is period T [s]"),
    (GROUP, 'initial={type="standing-wave", wave_amplitude=1}', "at most 0.681 m, where standing waves of this"),
    (GROUP, FORMULA, "must be left out (a ring's bed is flat)."),
    (GROUP, "gauges.1.x=25", "gauges.1.x = 25.0: must be inside the tank, 0 to 24 m"),
    (GROUP, 'gauges.1.name="1"', 'gauges.1.name = "1": must be a name that no other gauge has'),
    (GROUP, "gauges.1.y=2.0", "gauges.1.y = 2.0: must be left out: a slice has no width"),
    (GROUP, "numerics={cells=3, cell_size=0.1}", "must have at most one of the keys 'cells' and 'cell_size'"),
    (GROUP, "numerics.integrator=rk4", "numerics.integrator = \"rk4\": must be 'simpson-4', 'third-order', "),
    (OBLIQUE, "wall.segment=2.0", "wall.segment = 2.0: must be at most 1.541 m, the shortest wave's length over"),
    (OBLIQUE, "wall.reach=13.0", "wall.reach = 13.0: must be at most the tank's length, 12 m"),
    (OBLIQUE, "tank={length=9.0, depth=0.5}", 'wall.type = "segmented-piston": needs a basin'),
    (OBLIQUE, "wall.motion.angle=90.0", "wall.motion.angle = 90.0: must be"),
    (FOCUS, "wall.motion.focus_x=12.5", "wall.motion.focus_x = 12.5: must be inside the tank, below 12 m"),
    (FOCUS, "wall.motion.focus_y=17.5", "wall.motion.focus_y = 17.5: must be before the paddle"),
    (FOCUS, "wall.motion.focus_time=5.0", "wall.motion.focus_time = 5.0: must be at least "),
    (FOCUS, "wall.motion.largest_angle=50.0", "wall.motion.largest_angle = 50.0: must be at most 39.81 deg"),
    (FOCUS, "wall.motion.components=8", "wall.motion.components = 8: must be 21 or more"),
    (FOCUS.replace("directional", "reflected"), "wall.motion.focus_time=13.0", "focus_time = 13.0: must be at least"),
    (WAVES, "wall.motion={type='regular', height=1}", "one of the keys 'period' and 'frequency' and 'wave_length'"),
    (WAVES, "wall.motion.period=0.4", "wall.motion.height = 0.04: must be below that of the highest wave"),
    (WAVES, ["wall.motion.period=20", "wall.motion.height=0.1", SECOND], LINEAR + "the theory ends far below a second"),
    (WAVES, ["wall.motion.period=120.0", SECOND], LINEAR + "k d = 0.017 of the longest wave is below 0.02"),
    (WAVES, [SEA, "wall.motion.components=2001", SECOND], LINEAR + "2001 components are more than 2000"),
    (WAVES, [SEA, "wall.motion.components=9"], "must be 26 or more: so few repeat the waves every 6.4"),
    (WAVES, "wall.motion={type='bichromatic', heights=[0.1, 0.1], periods=[2, 2]}", "must have two waves of different"),
    (WAVES, SOLITARY, "wall.motion.crest_time = 2.0: must be at least 6."),
    (WAVES, "wall.limits.stroke=0.03", "wall.limits.stroke = 0.03: is too little: this motion needs"),
    (WAVES, "wall.limits.speed=0.01", "wall.limits.speed = 0.01: is too little: this motion needs"),
    (WAVES, "wall.limits.acceleration=0.1", "wall.limits.acceleration = 0.1: is too little: this motion needs"),
    (RING, "tank.type=slice", "needs a ring"),
    (RING, "initial.spectrum.peak_period=6.0", "nearly all is in that of "),
    (RING, "initial.highest_frequency=0.05", "of a wave as long as the tank"),
    (RING, [MEETING, "tank.type=slice", "initial.x=40.0"], "inside the tank"),
    (RING, [MEETING, "initial.linear_crest=0.9"], "less than the still-water"),
    (GROUP.replace("focus_x = 10.0", "focus_x = 30.0"), [], "line 17: wall.motion.focus_x = 30.0: must be inside the"),
    (GROUP.replace("{x = 4.0}", "{x = -4.0}"), [], "line 2: gauges.0.x = -4.0: must be inside the tank, 0 to 24 m."),
    (GROUP.replace("depth", "#"), [], "line 7: tank.depth: is missing; needed is still-water depth"),
    (f"[run]\nduration = 1\n[tank]\nlength = 3\ndepth = 1\n{2 * GAUGE}", [], "line 9: gauges.1.x"),
]


@pytest.mark.parametrize(("text", "changes", "said"), REFUSED, ids=[str(changes) for _, changes, _ in REFUSED])
def test_refusal_names_file_key_value_and_allowed_values(write_case, text, changes, said):
    path = write_case(text)
    message = refused(path, *([changes] if isinstance(changes, str) else changes))
    assert said in message
    assert all(line.startswith(f"{path}, ") and line.endswith(".") for line in message.splitlines())


def test_invalid_toml_is_refused_with_its_line(write_case):
    assert "line 2, column 6" in refused(write_case("title = 3\n[tank\n"))


def test_all_errors_are_listed(write_case):
    assert (
        len(refused(write_case(), "tank.depth=0", "run.duration=0", "numerics.dt=-1", "colour=blue").splitlines()) == 4
    )


@pytest.mark.parametrize("content", [None, b"\xff\xfe"])
def test_unreadable_case_is_refused(tmp_path, content):
    path = tmp_path / "case.toml"
    if content is not None:
        path.write_bytes(content)
    assert refused(path).startswith(f"{path}: cannot be read (")


@pytest.mark.parametrize(
    ("override", "said"),
    [
        *((text, "allowed is KEY=VALUE, such as numerics.dt=0.01.") for text in ("numerics.dt", "=3")),
        *((f"{key}.x=3", "there is no table or list to set it in.") for key in ("gauges.2", "gauges", "title")),
    ],
)
def test_override_of_no_key_is_refused(write_case, override, said):
    assert refused(write_case(), override) == f"override {override!r} received; {said}"


WORDS = "tank wall motion type gauges 0 7 x depth run duration numerics initial"
TEXTS = '1 -1 nan true "a" [] {} {type=1} piston [[ 1e400'
KEYS = st.sampled_from(["", "a b", *WORDS.split()])
VALUES = st.one_of(st.sampled_from(["", "[1, 2]", "a = b", "1\n2", *TEXTS.split()]), st.text(max_size=8))


@settings(max_examples=80)
@given(st.lists(KEYS, min_size=1, max_size=4).map(".".join), VALUES)
def test_any_override_gives_a_case_or_an_input_error(tmp_path_factory, key, value):
    path = tmp_path_factory.getbasetemp() / "case.toml"
    path.write_text(GROUP)
    try:
        case = read_case(path, [f"{key}={value}"])
    except InputError:
        return
    assert isinstance(case, Case)
