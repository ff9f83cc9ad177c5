"""Bad input: whatever a case says, it is a scene or a sentence; never another error, never for long."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from wavetank import data
from wavetank.case_file import SHOWN
from wavetank.errors import InputError
from wavetank.scene import Scene

CHECKOUT = Path(__file__).resolve().parents[1]
TANK = "[tank]\nlength = 8.0\ndepth = 1.0\n[run]\nduration = 1.0\n"


def refused(tmp_path, text, *overrides):
    """Return what the refusal of a case says."""
    path = tmp_path / "case.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        Scene.from_toml(path, overrides)
    return str(error.value)


# ---------------------------------------------------------------- what is no case
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = " + 5000 * "[" + 5000 * "]", "not valid TOML: nested too deeply"),
        ("x = " + 100_000 * "7", "not valid TOML: Exceeds the limit"),
        ("x = 0x" + 100_000 * "f", "x = int of no sensible size: is an unknown key"),
        ("title = '''\n" + 20_000 * " " + "\n'''\n" + TANK.replace("8", "-8"), "line 5: tank.length = -8.0: must be"),
        (b"\xef\xbb\xbf" + TANK.encode().replace(b"8.0", b"-8.0"), "line 2: tank.length = -8.0: must be"),
    ],
    ids=["nested", "digits", "hexadecimal", "spaces", "byte-order mark"],
)
def test_what_no_one_would_write_is_a_sentence(tmp_path, text, said):
    assert said in refused(tmp_path, text)


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    (tmp_path / "case.toml").write_text(TANK, encoding="utf-8-sig")
    assert Scene.from_toml(tmp_path / "case.toml").tank.length == 8.0


def test_thousands_of_mistakes_are_told_by_the_first_of_them(tmp_path):
    gauges = "".join(f"[[gauges]]\nx = {n}.5\n" for n in range(8, 3008))
    lines = refused(tmp_path, TANK + gauges).splitlines()
    assert len(lines) == SHOWN + 1
    assert lines[0].endswith("case.toml, line 7: gauges.0.x = 8.5: must be inside the tank, 0 to 8 m.")
    assert lines[-1].endswith(f"and {3000 - SHOWN} more mistakes.")


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("numerics.dt=0.01\nnumerics.order=2", "allowed is one value, without lines of others"),
        ("numerics.dt=0.01\n[tank]", "allowed is one value, without lines of others"),
        ("numerics.dt=" + 5000 * "[", "nested too deeply"),
        (f"gauges.{9 * '9'}.x=1", "override"),
        (f"gauges.{5000 * '9'}.x=1", "gauges"),
    ],
)
def test_an_override_is_one_value(tmp_path, override, said):
    assert said in refused(tmp_path, TANK + "[[gauges]]\nx = 1.0\n", override)


# ---------------------------------------------------------------- what a case refers to
@pytest.mark.parametrize("file", ["../../../etc/passwd", "/etc/passwd", "a/../../x", "./x", "a//x", "x\0", ""])
def test_a_file_of_a_data_set_is_in_its_folder(tmp_path, monkeypatch, file):
    monkeypatch.setenv("WAVETANK_DATA", str(tmp_path))
    for name in ("marin-202002", "..", "."):
        with pytest.raises(InputError, match=r"allowed is data:NAME/FILE"):
            data.resolve(f"data:{name}/{file}", tmp_path)


@pytest.mark.parametrize(("where", "line"), [("", 1), ("def depth(x, y):\n    ", 2)], ids=["file", "function"])
def test_a_bed_that_ends_the_program_is_an_error_of_the_bed(tmp_path, where, line):
    (tmp_path / "bed.py").write_text(f"{where}import sys; sys.exit(0)\n")
    text = TANK.replace("depth = 1.0", "depth = 1.0\nbed = {type = 'python', file = 'bed.py'}")
    if where:
        (tmp_path / "case.toml").write_text(text)
        bed = Scene.from_toml(tmp_path / "case.toml").tank.bed.build()
        with pytest.raises(InputError, match=rf"bed\.py, function 'depth', line {line}: SystemExit: 0"):
            bed(*2 * [np.zeros(3)])
    else:
        assert re.search(rf"line 4: tank\.bed\.file = .*bed\.py, line {line}: SystemExit: 0\.", refused(tmp_path, text))


def test_the_environment_needs_no_home():
    done = subprocess.run(
        ["env", "-u", "HOME", "-u", "WAVETANK_INSIDE", "./env", "sh", "-c", 'test -d "$HOME"'],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
