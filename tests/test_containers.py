"""The containers and the page on clusters say what `./env` and the package do."""

import re
import tomllib
from itertools import chain

from packaging.requirements import Requirement
from ranks import CHECKOUT

RECIPES = [CHECKOUT / "containers" / name for name in ("Dockerfile", "wavetank.def")]
OF_DEBIAN = CHECKOUT / "containers" / "debian-13.txt"
LOCK = CHECKOUT / "requirements-debian-13.txt"
HERE_ALONE = {"git", "make"}  # what a checkout needs, and a container does not


def packages(text: str) -> set[str]:
    """Return the Debian packages that a recipe installs."""
    listed = re.search(r"apt-get install --no-install-recommends -y \\\n(.*?)\n\s*(?:&&|rm)", text, flags=re.DOTALL)
    return set(listed[1].replace("\\", "").split())


def test_containers_have_the_packages_of_env():
    named = re.search(r'^packages="(.*?)"', (CHECKOUT / "env").read_text(), flags=re.DOTALL | re.MULTILINE)
    for recipe in RECIPES:
        assert packages(recipe.read_text()) == set(named[1].split()) - HERE_ALONE, recipe


def test_containers_install_this_package_and_name_no_private_place():
    commands = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["scripts"]
    for recipe in RECIPES:
        text = recipe.read_text()
        assert f"--require-hashes -r /opt/source/{LOCK.name}" in text and "--no-build-isolation /opt/source" in text
        assert "wavetank" in commands
        folders = {path.split("/")[1] for path in re.findall(r"(?<![\w.:$}])/\w[\w/.-]*", text)}
        assert folders <= {"opt", "var", "work", "bin"}
        assert "http" not in text


def test_the_users_environment_has_no_test_tools():
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    tools = {re.split(r"\W", one)[0] for one in project["optional-dependencies"]["test"]}
    entries = re.findall(r"^\s*- (\S+)", (CHECKOUT / "environment.yml").read_text(), re.M)
    listed = {re.split(r"[^\w-]", one)[0] for one in entries}
    assert not listed & tools
    needed = {re.split(r"[^\w-]", one)[0].lower() for one in project["dependencies"]}
    assert needed <= {one.lower() for one in listed}


def test_each_requirement_is_locked_with_hashes():
    """And has an allowed version; ``make lock`` makes the file."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    groups = project["dependencies"], *project["optional-dependencies"].values()
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
