"""Case files: allowed values, defaults, and messages for everything else."""

import ast
import pickle
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ranks import CHECKOUT

from wavetank.base.errors import InputError
from wavetank.base.schemes import SCHEMES
from wavetank.case import (
    Case,
    Gauge,
    Numerics,
    PistonWall,
    RunControl,
    SinusoidMotion,
    SliceTank,
)
from wavetank.case.reading import read_case
from wavetank.case.wall import AnyWall, ShapedWall
from wavetank.cli import main
from wavetank.integrators import Simpson4, registered
from wavetank.planning.cost import CONSTANTS, KINDS

CASES = Path(__file__).resolve().parents[1] / "cases"

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
    built = Case(
        gauges=(Gauge(name="1", x=1.0), Gauge(name="2", x=2.0), Gauge(name="end", x=5.0)),
        tank=SliceTank(length=5.0, depth=0.5),
        wall=PistonWall(motion=SinusoidMotion(paddle_amplitude=0.01, period=1.5)),
        run=RunControl(duration=3.0),
        numerics=Numerics(cell_size=0.25, integrator="stormer-verlet"),
    )
    assert read_case(write_case(text)) == built


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
    assert (case.cells, case.ends[0].reach) == (100, np.inf)
    assert case.surface_every == pytest.approx(0.5 * 9.81**-0.5)  # short against any wave period
    assert case.model_copy(update={"run": RunControl(duration=10.0)}).surface_every == 0.05  # 200 of them at least
    assert (case.wall.type, case.initial.type, case.tank.type, case.tank.gravity) == (
        "fixed",
        "still-water",
        "slice",
        9.81,
    )
    assert not case.motion().moves
    piston = PistonWall(motion=SinusoidMotion(paddle_amplitude=0.01, period=1.0))
    assert Case(tank=case.tank, run=case.run, wall=piston).ends[0].reach == 10.0
    assert Case(tank=SliceTank(length=3.0, depth=1.0), run=case.run, wall=piston).ends[0].reach == 3.0


@given(st.floats(0.1, 100.0), st.floats(0.1, 10.0), st.floats(0.01, 10.0))
def test_cells_divide_the_length(length, depth, size):
    tank = SliceTank(length=length, depth=depth)
    assert Numerics(cells=7).cells_in(tank) == 7
    for numerics, wanted in ((Numerics(), depth / 5), (Numerics(cell_size=size), size)):
        cells = numerics.cells_in(tank)
        assert cells >= 1
        # the nearest whole number of cells
        assert cells == 1 or abs(length / wanted - cells) <= 0.5 * (1 + 1e-12)


@pytest.mark.parametrize("key", ["position", "velocity"])
def test_record_path_is_relative_to_the_case(write_case, tmp_path, key):
    t = np.linspace(0.0, 30.0, 301)
    np.savetxt(tmp_path / "paddle.dat", np.column_stack([t, 0.01 * np.sin(t)]), fmt="%.17g")
    path = write_case(
        GROUP.replace("[wall.motion]", f'[wall.motion]\ntype = "recorded"\n{key} = "paddle.dat"\n[group]')
    )
    text = path.read_text()
    path.write_text(text[: text.index("[group]")] + text[text.index("[run]") :])
    case = read_case(path)
    # the integral of 0.01 sin t is 0.01 (1 - cos t); the spline's error is of the order of (0.1)^4 / 384
    expected = {"position": 0.01 * np.sin(7.77), "velocity": 0.01 * (1 - np.cos(7.77))}[key]
    assert case.motion().position(7.77) == pytest.approx(expected, abs=1e-8)
    assert Case.model_validate(case.model_dump(mode="json")).motion().position(7.77) == case.motion().position(7.77)
    said = refused(path, "run.duration=31")
    assert said == f"{path}, overridden: run.duration = 31.0: must be at most 30 s, where the recorded motion ends."


def test_recorded_motion_reads_a_named_column_with_gain(write_case, tmp_path):
    t = np.linspace(0.0, 30.0, 301)
    (tmp_path / "paddle.csv").write_text("t,flap,gauge\n" + "".join(f"{one},{0.01 * one},7\n" for one in t))
    motion = 'wall.motion={type="recorded", position="paddle.csv", gain=-2.0, column='
    assert read_case(write_case(), [f'{motion}"flap"}}', "run.duration=20"]).motion().position(7.77) == pytest.approx(
        -0.1554
    )
    slow = read_case(write_case(), [f'{motion}"flap", highest_frequency=1.9}}', "run.duration=20"]).motion()
    assert slow.velocity(np.linspace(1.0, 29.0, 9)) == pytest.approx(-0.02, rel=1e-9)
    with pytest.raises(InputError, match=r"2.4 Hz received; must be at most 1.9.* Hz, a fifth"):
        read_case(write_case(), [f'{motion}"flap", highest_frequency=2.4}}', "run.duration=20"])
    with pytest.raises(InputError, match="paddle.csv: has no column 'piston'; its columns are t, flap, gauge"):
        read_case(write_case(), [f'{motion}"piston"}}', "run.duration=20"])


@pytest.mark.parametrize("key", ["position", "velocity"])
def test_gap_in_recorded_motion_is_refused(write_case, tmp_path, key, capsys):
    """Of a period of 2 s, rows every 0.01 s: a gap of a quarter period and random times are allowed, 4 s are not."""
    t = np.arange(3001) / 100
    random = np.random.default_rng(7).uniform(size=t.size) < 0.2
    random[-1] = True

    def write(without):
        rows = np.column_stack([t, 0.03 * np.sin(np.pi * t)])[~without]
        np.savetxt(tmp_path / "paddle.dat", rows, fmt="%.9g")
        return 'wall.motion={type="recorded", ' + f'{key}="paddle.dat"' + "}"

    for without in ((t > 10) & (t < 10.49), ~random):
        assert read_case(write_case(), [write(without), "run.duration=20"]).motion().duration == 30.0
    gap = write((t > 10) & (t < 14))
    assert main(["plan", str(write_case()), "--set", gap, "--set", "run.duration=20"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "paddle.dat, line 1002: gap of 4 s after t = 10 s; allowed are 0.5 s" in said
    assert f"wall.motion.{key} = " in said and said.endswith("(median interval 0.01 s, period about 2 s): add rows.")


def test_case_with_cached_motion_is_picklable(write_case):
    """A formula's motion is made of functions, which none can be sent."""
    case = read_case(write_case(), ['wall.motion={type="formula", position="0.01*sin(t)"}'])
    assert case.motion().position(1.0) == pickle.loads(pickle.dumps(case)).motion().position(1.0)


def test_every_integrator_with_costs_is_registered():
    for file in (CHECKOUT / "wavetank" / "integrators").glob("*.py"):
        schemes = (one for one in ast.walk(ast.parse(file.read_text())) if isinstance(one, ast.ClassDef))
        for scheme in schemes:
            if any(ast.unparse(line).startswith("costs: ClassVar") for line in scheme.body):
                entry = file.stem, scheme.name
                assert entry in SCHEMES.values(), f"{entry} is missing in wavetank/base/schemes.py"


def test_every_shape_of_a_wall_is_one_that_a_case_can_name():
    kinds, left = [*ShapedWall.__subclasses__()], []
    while kinds:
        kind = kinds.pop()
        kinds += kind.__subclasses__()
        left += [kind.__name__] if "type" in kind.model_fields and kind not in get_args(AnyWall) else []
    assert not left, f"{left}: missing in AnyWall of wavetank/case/wall.py"


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
    overrides = [
        "numerics.dt=0.01",
        "numerics.integrator=stormer-verlet",
        "gauges.1.x=12",
        "title=two words",
        "tank.length=30.0",
    ]
    case = read_case(
        write_case(), [*overrides, 'wall.motion.spectrum={type="gaussian", peak_frequency=0.6, bandwidth=0.1}']
    )
    assert (case.numerics.dt, case.numerics.integrator, case.title) == (0.01, "stormer-verlet", "two words")
    assert case.gauges == (Gauge(name="1", x=4.0), Gauge(name="focus", x=12.0))
    assert case.tank.length == 30.0
    assert case.wall.motion.spectrum.bandwidth == 0.1


# ---------------------------------------------------------------- what is not
@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("tank.depth=-1", "tank.depth = -1: must be greater than or equal to 1e-06 (still-water depth d [m];"),
        ("tank.depth=inf", "tank.depth = Infinity: must be a finite number (still-water depth d [m];"),
        ('tank.depth="1.0"', 'tank.depth = "1.0": must be a valid number (still-water depth d [m];'),
        (
            "windows=[{name='a', start=[1, 0], end=[1, 0], columns=3, every=0.1}]",
            "must be another place than the start",
        ),
        (
            "tank.lenght=3",
            "tank.lenght = 3: is an unknown key; did you mean 'length'? allowed are: bed, density, depth, ",
        ),
        ("tank=3", "tank = 3: must be a table; allowed are: bed, density, depth, gravity, layout, length, type"),
        ("tank.type=pond", 'tank.type = "pond": is an unknown type; allowed are: slice, ring, basin'),
        ("wall.type=crane", 'wall.type = "crane": is an unknown type; allowed are: fixed, piston, flap, profile'),
        ("wall={reach=3}", "wall.type: is missing; allowed are: fixed, piston"),
        ("tank.sponge={length=2.0}", "tank.sponge = "),
        ("gauge=[{x=1.0}]", "is an unknown key; did you mean 'gauges'? allowed are: far_wall, gauge_lines, "),
        ("wall={type='profile',shape='1 + z/d'}", "tanh, where, z; what it stands for is said by where = { d = ... }"),
        ("wall.absorb=true", "wall.absorb = true: must be a table; allowed are: damping, longest, mass, period, "),
        (
            "wall.absorb={type='active', period=2.0}",
            "absorb.period = 2.0: is an unknown key; allowed are: longest, ",
        ),
        ("numerics.phase=0.1", "numerics.phase = 0.1: is an unknown key"),
        ("wall.motion={type='oblique-wave'}", 'wall.motion.type = "oblique-wave": is an unknown type;'),
        ("wall={type='segmented-piston', motion={type='at-rest'}}", "is an unknown type; allowed are: oblique-wave, "),
        ("wall.type=fixed", "wall.motion = {"),
        ("run.dt=0.01", "allowed are: checkpoint_every, duration, on_breaking."),
        (
            'wall.motion={type="sinusoid", paddle_amplitude=10, period=2}',
            "3/4 of its reach, which is 10 m by default",
        ),
        ("wall.reach=0.01", "wall.reach = 0.01: must be more than 0.06144 m, 4/3 of"),
        ("wall.motion.type=sinusiod", "wall.motion.type = \"sinusiod\": is an unknown type; did you mean 'sinusoid'?"),
        ("wall.motion.focus_time=9", "wall.motion.focus_time = 9.0: must be at least"),
        ("wall.motion.components=9", "components = 9: must be 22 or more: so few repeat the waves every 9.143 s"),
        (
            "wall.motion.lowest_frequency=0.7",
            "motion.spectrum: must have its peak, 0.65 Hz, within the components'",
        ),
        ('wall.motion={type="recorded"}', "must have exactly one of the keys 'position' and 'velocity'"),
        (
            'wall.motion={type="sinusoid", paddle_amplitude=0.1}',
            "motion.period: is missing; needed is period T [s]",
        ),
        ('initial={type="standing-wave", wave_amplitude=1}', "must be at most 0.681 m, where standing waves of this"),
        ('tank={type="ring", length=9, depth=1, bed={type="formula"}}', "must be left out (a ring's bed is flat)."),
        ("gauges.1.x=25", "gauges.1.x = 25.0: must be inside the tank, 0 to 24 m"),
        ('gauges.1.name="1"', 'gauges.1.name = "1": must be a name that no other gauge has'),
        ("gauges.1.y=2.0", "gauges.1.y = 2.0: must be left out: a slice has no width"),
        ("numerics={cells=3, cell_size=0.1}", "must have at most one of the keys 'cells' and 'cell_size'"),
        ("numerics.integrator=rk4", "numerics.integrator = \"rk4\": must be 'simpson-4', 'third-order', "),
    ],
)
def test_refusal_names_file_key_value_and_allowed_values(write_case, override, said):
    path = write_case()
    message = refused(path, override)
    assert said in message
    assert all(line.startswith(f"{path}, ") and line.endswith(".") for line in message.splitlines())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GROUP.replace("focus_x = 10.0", "focus_x = 30.0"), "line 17: wall.motion.focus_x = 30.0: must be inside the"),
        (GROUP.replace("{x = 4.0}", "{x = -4.0}"), "line 2: gauges.0.x = -4.0: must be inside the tank, 0 to 24 m."),
        (GROUP.replace("depth", "#"), "line 7: tank.depth: is missing; needed is still-water depth"),
        (
            "[tank]\nlength = 3\ndepth = 1\n[run]\nduration = 1\n[[gauges]]\nx = 2\n[[gauges]]\nx = 9\n",
            "line 9: gauges.1.x",
        ),
        ("title = 3\n[tank\n", "line 2, column 6"),
    ],
)
def test_refusal_names_the_line(write_case, text, said):
    assert said in refused(write_case(text))


def test_all_errors_are_listed(write_case):
    said = refused(write_case(), "tank.depth=0", "run.duration=0", "numerics.dt=-1", "colour=blue")
    assert len(said.splitlines()) == 4


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
