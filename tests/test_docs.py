"""Fenced blocks, links, figures and sentences of README and docs.

The commands of a block run in sequence, complete or shortened, with runs/ in a temporary folder.
"""

import re
import shlex
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
from conftest import commanded, needs_marin, recorded
from ranks import CHECKOUT, launch

from wavetank.case.reading import read_case

DOCS = CHECKOUT / "docs"
PAGES = [CHECKOUT / "README.md", CHECKOUT / "CONTRIBUTING.md", CHECKOUT / "cases" / "README.md"]
PAGES += sorted({*DOCS.glob("**/*.md")} - {DOCS / "extend.md"})  # tested in test_public.py
EVERY_PAGE = [*PAGES, DOCS / "extend.md", CHECKOUT / "CHANGELOG.md", CHECKOUT / "meshes" / "README.md"]


class Block(NamedTuple):
    """A fenced block: its page and line, language and text."""

    where: str
    language: str
    text: str

    @property
    def commands(self) -> list[str]:
        """The lines without comments."""
        lines = (line.partition("#")[0].strip() for line in self.text.splitlines())
        return [line for line in lines if line]


def blocks_of(page: Path) -> list[Block]:
    text, name = page.read_text(), str(page.relative_to(CHECKOUT))
    matches = re.finditer(r"^```(\w*)\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return [Block(f"{name}:{len(text[: one.start()].splitlines()) + 1}", one[1], one[2]) for one in matches]


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def in_language(language: str) -> list:
    return [pytest.param(block, id=block.where) for block in BLOCKS if block.language == language]


WAVETANK = "./env wavetank "
SHORTER = (  # (pattern of commands, arguments with which they take seconds)
    (r"make test$", "TESTS=tests/test_vertical.py"),
    (r"make test-slow$", "'TESTS=tests/test_linear_waves.py -k error_is_the_oscillators'"),
    (r"make bench$", "'BENCH=--only profile --steps 1'"),
    (r".* run cases/berkhoff-1982.toml ", "--no-plots --set run.duration=0.1 --set numerics.cell_size=2.5"),
    (r".* run cases/marin-202002.toml ", "--no-plots --set run.duration=0.2 --set numerics.cell_size=1.0"),
    (r".* wavetank run ", "--no-plots --set run.duration=0.2"),
)
SLOW = r"make (bench|test|test-slow)$|.* run cases/berkhoff-1982.toml "  # run in slow tests only
STUDY = next(one for block in BLOCKS for one in block.commands if one.startswith(f"{WAVETANK}study "))
TESTED_IN = {  # commands that take long or need a network: the file that tests them, and its text
    "make run": ("test_cli.py", "make run"),
    "./env wavetank data fetch marin-202002": ("test_data.py", "fetch("),
    "./env wavetank verify integrators --out runs/integrators": ("test_verify.py", "integrators.PARTS"),
    STUDY: ("test_study.py", "wavetank (study .*)$"),
}


def shortened(command: str) -> str:
    return next((f"{command} {more}" for pattern, more in SHORTER if re.match(pattern, command)), command)


def run_command(command: str, runs: Path, *, shell: bool = False) -> None:
    """Run a command in this process if it is ``wavetank``, else in a shell."""
    text = command.replace("runs/", f"{runs}/")
    if command.startswith(WAVETANK) and not shell:
        result = commanded(*shlex.split(text.removeprefix(WAVETANK)))
    else:
        result = launch(["sh", "-c", text])
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    assert result.stdout or any(runs.iterdir())


def skip_without_data(block: Block) -> None:
    if "cases/marin-202002.toml" in block.text:
        needs_marin()


def test_blocks_are_in_known_languages():
    assert len(in_language("sh")) >= 3 and in_language("python")
    assert {block.language for block in BLOCKS} <= {"sh", "python", "toml", "text"}


@pytest.mark.parametrize("block", in_language("sh"))
def test_commands_run_in_sequence(block, tmp_path):
    skip_without_data(block)
    for command in block.commands:
        if command not in TESTED_IN and not re.match(SLOW, command):
            run_command(shortened(command), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("block", in_language("sh"))
def test_slow_commands_run_shortened(block, tmp_path):
    for command in block.commands:
        if re.match(SLOW, command):
            run_command(shortened(command), tmp_path, shell=True)


@pytest.mark.parametrize("command", TESTED_IN)
def test_commands_tested_in_other_files_are_in_blocks(command):
    assert any(command in block.commands for block in BLOCKS)
    file, text = TESTED_IN[command]
    assert text in (CHECKOUT / "tests" / file).read_text()


@pytest.mark.slow
@pytest.mark.parametrize("block", in_language("sh"))
def test_commands_run_complete(block, tmp_path):
    """Without this suite and downloads."""
    skip_without_data(block)
    for command in block.commands:
        if not re.match(r"make (run|test)|.* data fetch ", command):
            run_command(command, tmp_path, shell=True)


@pytest.mark.parametrize("block", in_language("toml"))
def test_cases_are_read(block, tmp_path):
    """Complete cases are read as cases, parts as TOML."""
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
        changes = ("numerics.cell_size=1.0", "numerics.vertical_order=4", "run.duration=0.2")
        if (case := CHECKOUT / "cases" / f"{name}.toml").exists():
            recorded(case, changes, folder / "runs" / name)
    (folder / "cases").symlink_to(CHECKOUT / "cases")
    return folder


@pytest.mark.parametrize("block", in_language("python"))
def test_snippets_run(block, small_runs, monkeypatch):
    monkeypatch.chdir(small_runs)
    monkeypatch.setattr("pyvista.OFF_SCREEN", True)
    exec(block.text, {})


# ---------------------------------------------------------------- links, figures, sentences
def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", EVERY_PAGE, ids=lambda page: str(page.relative_to(CHECKOUT)))
def test_links_lead_to_files_and_headings(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        path, _, anchor = link.partition("#")
        target = (page.parent / path) if path else page
        if not link.startswith("https:"):
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", sorted({*DOCS.glob("*.md")} - {DOCS / "architecture.md"}), ids=lambda page: page.name)
def test_mean_sentence_has_at_most_20_words(page):
    text = re.sub(r"^```.*?^```|^(\||#|!|    ).*?$", "\n", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    paragraphs = re.split(r"\n\s*\n|\n\s*(?:[-*]|\d+\.) ", re.sub(r"\]\([^)]*\)", "]", text))
    sentences = [one for each in paragraphs for one in re.split(r"(?<=[.!?:])\s+", each) if one.strip()]
    assert sum(len(one.split()) for one in sentences) <= 20 * len(sentences)


def test_every_figure_is_on_a_page():
    shown = {
        (page.parent / path).resolve()
        for page in EVERY_PAGE
        for path in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text())
    }
    assert shown == {path.resolve() for path in (DOCS / "figures").rglob("*.png")}


def test_gallery_gives_a_command_or_page_for_each_figure():
    """The cases that it names exist, and README links it."""
    text = (DOCS / "gallery.md").read_text()
    captions = [part.rpartition("\n\n**")[2] for part in text.split("![")[:-1]]
    assert len(captions) > 10 and all("./env wavetank " in one or ".md)" in one for one in captions)
    for case in re.findall(r"cases/[\w-]+\.toml", text):
        assert (CHECKOUT / case).exists()
    assert "docs/gallery.md" in (CHECKOUT / "README.md").read_text()
