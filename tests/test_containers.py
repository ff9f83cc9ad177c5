"""Containers, environments and the source distribution have what `./env`, pyproject.toml and git list."""

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from itertools import chain

import pytest
from packaging.requirements import Requirement
from ranks import CHECKOUT

RECIPES = [CHECKOUT / "containers" / name for name in ("Dockerfile", "wavetank.def")]
OF_DEBIAN = CHECKOUT / "containers" / "debian-13.txt"
LOCK = CHECKOUT / "requirements-debian-13.txt"
HERE_ALONE = {"git", "make"}  # what a checkout needs, and a container does not


PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]


def packages(text: str) -> set[str]:
    """Return the Debian packages that a recipe installs."""
    listed = re.search(r"apt-get install --no-install-recommends -y \\\n(.*?)\n\s*(?:&&|rm)", text, flags=re.DOTALL)
    return set(listed[1].replace("\\", "").split())


def test_containers_have_the_packages_of_env():
    named = re.search(r'^packages="(.*?)"', (CHECKOUT / "env").read_text(), flags=re.DOTALL | re.MULTILINE)
    for recipe in RECIPES:
        assert packages(recipe.read_text()) == set(named[1].split()) - HERE_ALONE, recipe


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_containers_install_this_package_and_name_no_private_place(recipe):
    text = recipe.read_text()
    assert f"--require-hashes -r /opt/source/{LOCK.name}" in text and "--no-build-isolation /opt/source" in text
    assert "wavetank" in PROJECT["scripts"]
    folders = {path.split("/")[1] for path in re.findall(r"(?<![\w.:$}])/\w[\w/.-]*", text)}
    assert folders <= {"opt", "var", "work", "bin"} and "http" not in text


def test_the_users_environment_has_what_is_needed_and_no_test_tools():
    entries = re.findall(r"^\s*- ([\w-]+)", (CHECKOUT / "environment.yml").read_text(), re.M)
    listed = {one.lower() for one in entries}
    tools, needed = (
        {Requirement(one).name.lower() for one in group}
        for group in (PROJECT["optional-dependencies"]["test"], PROJECT["dependencies"])
    )
    assert not listed & tools and needed <= listed


def test_each_requirement_is_locked_with_hashes():
    """And has an allowed version; ``make lock`` makes the file."""
    groups = PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()
    entries = re.split(r"\n(?=\S)", re.sub(r"^#.*\n", "", LOCK.read_text(), flags=re.MULTILINE))
    locked = dict(entry.split(maxsplit=1)[0].split("==") for entry in entries)
    assert all("--hash=sha256:" in entry for entry in entries)
    for requirement in map(Requirement, chain(*groups)):
        assert requirement.specifier.contains(locked[requirement.name.lower()]), requirement
    assert locked.items() >= dict(re.findall(r"^([\w-]+)==(\S+)$", OF_DEBIAN.read_text(), flags=re.MULTILINE)).items()


def test_dockerfile_runs_as_a_user_without_a_shared_cache():
    text = (CHECKOUT / "containers" / "Dockerfile").read_text()
    assert re.search(r"^USER (?!root)\w+$", text, flags=re.MULTILINE) and "chmod" not in text and "1777" not in text
    assert re.search(r"^ARG BASE=debian:trixie-slim\nFROM \$\{BASE\}$", text, flags=re.MULTILINE)


BUILD = "from setuptools.build_meta import build_sdist; build_sdist('dist')"


@pytest.mark.skipif(not (CHECKOUT / ".git").exists(), reason="files under version control are not known")
def test_the_source_distribution_contains_all_files_of_the_repository(tmp_path):
    listed = subprocess.run(["git", "ls-files"], cwd=CHECKOUT, check=True, capture_output=True, text=True).stdout
    files = [name for name in listed.splitlines() if (CHECKOUT / name).exists()]
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(CHECKOUT / name, tmp_path / name, follow_symlinks=False)
    subprocess.run([sys.executable, "-c", BUILD], cwd=tmp_path, check=True, capture_output=True)
    (built,) = (tmp_path / "dist").iterdir()
    with tarfile.open(built) as archive:
        contained = {name.partition("/")[2] for name in archive.getnames()}
    assert {"cases/focusing.toml", "docs/method.md", "environment.yml"} <= contained
    assert set(files) - contained <= {".gitignore"}
    assert "examples/paper/__init__.py" in contained
