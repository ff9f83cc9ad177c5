"""What README and docs tell a reader to type: every fenced block of theirs runs, as it stands or shortened by one rule.

A block's commands run one after the other, as a reader would type them, with runs/ in a folder of their own.
"""

import re
import shlex
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from conftest import commanded, needs_marin, recorded
from ranks import CHECKOUT, launch

from wavetank.case.reading import read_case

PAGES = [CHECKOUT / "README.md", CHECKOUT / "CONTRIBUTING.md", CHECKOUT / "cases" / "README.md"]
PAGES += sorted(
    {*(CHECKOUT / "docs").glob("**/*.md")} - {CHECKOUT / "docs" / "extend.md"}
)  # its own: tests/test_public.py


class Block(NamedTuple):
    """A fenced block: where it begins, its language, and what is in it."""

    where: str
    language: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Its lines without comments."""
        lines = (line.partition("#")[0].strip() for line in self.text.splitlines())
        return [line for line in lines if line]


def blocks_of(page: Path) -> list[Block]:
    text, name = page.read_text(), str(page.relative_to(CHECKOUT))
    found = re.finditer(r"^```(\w*)\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return [Block(f"{name}:{len(text[: one.start()].splitlines()) + 1}", one[1], one[2]) for one in found]


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def in_language(language: str) -> list:
    return [pytest.param(block, id=block.where) for block in BLOCKS if block.language == language]


SHORTER = (  # the rule: (commands, what is put behind them so that they take seconds)
    (r"make test$", "TESTS=tests/test_vertical.py"),
    (r"make test-slow$", "'TESTS=tests/test_linear_waves.py -k error_is_the_oscillators'"),
    (r"make bench$", "'BENCH=--only profile --steps 1'"),
    (r".* run cases/berkhoff-1982.toml ", "--no-plots --set run.duration=0.1 --set numerics.cell_size=2.5"),
    (r".* run cases/marin-202002.toml ", "--no-plots --set run.duration=0.2 --set numerics.cell_size=1.0"),
    (r".* wavetank run ", "--no-plots --set run.duration=0.2"),
)
OWN = "./env wavetank "
LATER = (
    r"make (bench|test|test-slow)$|.* run cases/berkhoff-1982.toml "  # typed in slow tests alone, shortened and whole
)
ELSEWHERE = {  # commands too long even so, or that need a network: the file whose tests run what they run
    "make run": "tests/test_cli.py",
    "./env wavetank data fetch marin-202002": "tests/test_data.py",
    "./env wavetank verify integrators --out runs/integrators": "tests/test_verify.py",
    next(one for block in BLOCKS for one in block.commands if one.startswith(f"{OWN}study ")): "tests/test_study.py",
}


def shortened(command: str) -> str:
    return next((f"{command} {more}" for pattern, more in SHORTER if re.match(pattern, command)), command)


def typed(command: str, runs: Path) -> None:
    """Type a command as a reader would, with runs/ in another folder."""
    went_well(command, launch(["sh", "-c", command.replace("runs/", f"{runs}/")]), runs)


def called(command: str, runs: Path) -> None:
    """Call the tank's own command line with the words of a command: what is tested is not how Python starts."""
    words = shlex.split(command.removeprefix(OWN).replace("runs/", f"{runs}/"))
    went_well(command, commanded(*words), runs)


def went_well(command: str, result: Any, runs: Path) -> None:
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    assert result.stdout or any(runs.iterdir())


def needs(block: Block) -> None:
    """Skip a block whose data are not on this machine."""
    if "cases/marin-202002.toml" in block.text:
        needs_marin()


def test_there_are_blocks_and_of_languages_that_run():
    assert len(in_language("sh")) >= 3 and in_language("python")
    assert {block.language for block in BLOCKS} <= {"sh", "python", "toml", "text"}


@pytest.mark.parametrize("block", in_language("sh"))
def test_commands_run_one_after_the_other(block, tmp_path):
    needs(block)
    for command in block.commands:
        if command not in ELSEWHERE and not re.match(LATER, command):
            (called if command.startswith(OWN) else typed)(shortened(command), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("block", in_language("sh"))
def test_dear_commands_run_shortened(block, tmp_path):
    for command in block.commands:
        if re.match(LATER, command):
            typed(shortened(command), tmp_path)


@pytest.mark.parametrize(("command", "file"), ELSEWHERE.items())
def test_what_runs_elsewhere_is_in_a_block_and_has_its_tests(command, file):
    assert any(command in block.commands for block in BLOCKS)
    word = {"make run": "make run", "data": "fetch(", "verify": "integrators.PARTS", "study": "wavetank (study .*)$"}
    assert next(found for key, found in word.items() if key in command) in (CHECKOUT / file).read_text()


@pytest.mark.slow
@pytest.mark.parametrize("block", in_language("sh"))
def test_commands_run_as_they_stand(block, tmp_path):
    """But for this suite itself, what is downloaded, and what the default tests run as it stands."""
    needs(block)
    for command in block.commands:
        if not re.match(r"make (run|test)|.* data fetch ", command):
            typed(command, tmp_path)


@pytest.mark.parametrize("block", in_language("toml"))
def test_cases_are_read(block, tmp_path):
    """Parts of cases are TOML at least, whole cases are cases."""
    keys = tomllib.loads(block.text)
    if {"tank", "run"} <= set(keys):
        (tmp_path / "case.toml").write_text(block.text)
        read_case(tmp_path / "case.toml")


@pytest.fixture(scope="module")
def small_runs(tmp_path_factory):
    """A folder with short runs of the cases that snippets name as runs/CASE."""
    folder = tmp_path_factory.mktemp("reader")
    texts = " ".join(block.text for block in BLOCKS if block.language == "python")
    for name in set(re.findall(r"runs/([\w-]+)", texts)):
        changes = ("numerics.cell_size=1.0", "numerics.vertical_order=2", "run.duration=0.2")
        if (case := CHECKOUT / "cases" / f"{name}.toml").exists():
            recorded(case, changes, folder / "runs" / name)
    (folder / "cases").symlink_to(CHECKOUT / "cases")
    return folder


@pytest.mark.parametrize("block", in_language("python"))
def test_snippets_run(block, small_runs, monkeypatch):
    """On a small run, without a screen."""
    monkeypatch.chdir(small_runs)
    monkeypatch.setattr("pyvista.OFF_SCREEN", True)
    exec(block.text, {})


def test_the_snippet_for_pyvista_runs_for_a_slice_as_its_comment_says(small_runs, monkeypatch):
    monkeypatch.chdir(small_runs)
    monkeypatch.setattr("pyvista.OFF_SCREEN", True)
    (text,) = (block.text for block in BLOCKS if block.language == "python" and "pyvista" in block.text)
    assert "# of a slice: surface.xdmf" in text
    exec(text.replace("runs/bend/surface.pvd", "runs/focusing/surface.xdmf"), made := {})
    assert made["surface"].n_cells == 1  # the line


# ---------------------------------------------------------------- pictures
FIGURES = CHECKOUT / "docs" / "figures"
EVERY_PAGE = [*PAGES, CHECKOUT / "CHANGELOG.md", CHECKOUT / "meshes" / "README.md"]


def shown(page: Path) -> set[Path]:
    """Return the figures that a page shows."""
    found = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text())
    return {(page.parent / one).resolve() for one in found}


def test_every_figure_stands_on_a_page_and_every_page_finds_its_figures():
    on_pages = set().union(*map(shown, EVERY_PAGE))
    assert on_pages == {path.resolve() for path in FIGURES.rglob("*.png")}


def test_the_gallery_tells_how_each_picture_is_made():
    """A command, or the page that has it, before each; cases and pages are there; README links it."""
    gallery = CHECKOUT / "docs" / "gallery.md"
    text = gallery.read_text()
    captions = [part.rpartition("\n\n**")[2] for part in text.split("![")[:-1]]
    assert len(captions) > 10 and all("./env wavetank " in one or ".md)" in one for one in captions)
    for case in re.findall(r"cases/[\w-]+\.toml", text):
        assert (CHECKOUT / case).exists()
    for page in re.findall(r"\]\(([^)]+\.md)\)", text):
        assert (gallery.parent / page).exists()
    assert "docs/gallery.md" in (CHECKOUT / "README.md").read_text()
