"""The schema of a manifest: types of the keys that are read of it; further keys are allowed.

A scene is validated as such where a run is resumed (``case/``). Here are the keys of it that figures, comparisons and
analyses use, also of a run of another version of this program.
"""

import json
import os
import platform
import subprocess
import sys
from contextlib import suppress
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import AwareDatetime, BaseModel, ConfigDict, ValidationError

from wavetank.errors import InputError, printable
from wavetank.output.files import open_regular

MANIFEST = "manifest.json"
LARGEST = 10**8  # bytes; a larger one is not read


class Part(BaseModel):
    """A part of a manifest: finite numbers, no conversion of types."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class Layout(Part):
    """The recipe of a basin's walls."""

    length: float | None = None


class Tank(Part):
    """The tank [m, m/s², kg/m³]."""

    type: str | None = None
    depth: float | None = None
    length: float | None = None
    gravity: float = 9.81
    density: float = 1000.0
    layout: Layout | None = None


class Motion(Part):
    """The motion of a wall [s, Hz]."""

    type: str | None = None
    period: float | None = None
    frequency: float | None = None


class Wall(Part):
    """A wall at an end of the tank."""

    type: str | None = None
    motion: Motion | None = None


class Sponge(Part):
    """A sponge [m]."""

    type: str
    length: float | None = None


class Named(Part):
    """A gauge, or a line of gauges."""

    name: str


class Numerics(Part):
    """Numerics; the step [s]."""

    order: int | None = None
    dt: float | None = None


class Timing(Part):
    """What a run is asked to do [s]."""

    duration: float


class Case(Part):
    """The scene."""

    title: str = ""
    tank: Tank = Tank()
    wall: Wall = Wall()
    far_wall: Wall | None = None
    sponge: Sponge | None = None
    gauge_lines: list[Named] = []
    run: Timing | None = None
    numerics: Numerics = Numerics()


class Planned(Part):
    """What was planned of the scene."""

    numerics: Numerics = Numerics()


class Progress(Part):
    """How far a run has come [s]."""

    t: float = 0.0
    begin: float = 0.0
    end: float | None = None
    wall_s: float = 0.0


class Crest(Part):
    """The highest crest [m, s]."""

    height: float
    x: float
    t: float


class SteepCrest(Part):
    """A crest of a run that broke down [m], with B = u/c."""

    x: float
    height: float
    speed_ratio: float


class Breakdown(Part):
    """When and where a run broke down [s], the values at the steepest place by their names."""

    t: float
    steepest: dict[str, float]
    crests: list[SteepCrest]


class Breaking(Part):
    """Waves that broke and were dissipated."""

    waves: int = 0


class WarningRecord(Part):
    """A warning of a run (``wavetank/run_warning.py``)."""

    code: str
    message: str
    key: str = ""
    value: float | None = None
    limit: float | None = None
    t: float | None = None
    x: float | None = None
    y: float | None = None
    until: float | None = None
    details: dict[str, float | str] = {}


class Manifest(Part):
    """The manifest."""

    status: str = ""
    id: str | None = None
    host: str | None = None
    git: str | None = None
    started: str = ""
    written: AwareDatetime | None = None
    cause: str = ""
    command: list[str] = []
    warnings: list[WarningRecord | str] = []  # sentences in older manifests
    versions: dict[str, str] = {}
    files: dict[str, str] = {}
    scene: Case = Case()
    planned: Planned | None = None
    progress: Progress = Progress()
    numerics: Numerics = Numerics()
    timings: dict[str, float] = {}
    counters: dict[str, int] = {}
    memory: dict[str, float] = {}
    highest_crest: Crest | None = None
    broke_down: Breakdown | None = None
    breaking: Breaking = Breaking()


def read_manifest(run: Path) -> dict[str, Any]:
    """Return the manifest of a run directory; raise ``InputError`` where there is none, or a value of a wrong type."""
    try:
        with open_regular(run / MANIFEST) as file:
            if os.fstat(file.fileno()).st_size > LARGEST:
                raise _missing(run)
            content = file.read()
        manifest: dict[str, Any] = json.loads(content)
        Manifest.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        if not first["loc"]:
            raise _missing(run) from None
        key, why = ".".join(map(str, first["loc"])), first["msg"]
        raise InputError(printable(f"{run / MANIFEST}: {key}: {why[:1].lower()}{why[1:]}.")) from None
    except (OSError, ValueError, RecursionError):
        raise _missing(run) from None
    return manifest


def _missing(run: Path) -> InputError:
    return InputError(f"{run}: is no run directory (no readable {MANIFEST} in it).")


def environment() -> dict[str, Any]:
    """Return what identifies the program of a run: versions, host, command and git revision."""
    return {
        "versions": {"python": platform.python_version(), **_versions()},
        "host": platform.node(),
        "system": platform.platform(),
        "command": sys.argv,
        "git": _revision(),
        "started": now(),
    }


def _versions() -> dict[str, str]:
    """Return the versions of the installed libraries that affect results."""
    versions = {}
    for name in ("wavetank", "numpy", "scipy", "dolfinx", "ufl", "basix", "petsc4py", "mpi4py"):
        with suppress(ImportError):
            versions[name] = str(getattr(import_module(name), "__version__", "unknown"))
    return versions


def _revision() -> str | None:
    """Return the checkout's revision, marked if it is changed; None outside a checkout."""
    folder = Path(__file__).resolve().parent
    command = ["git", "-c", "safe.directory=*", "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return result.stdout.strip() or None


def current_time() -> datetime:
    """Return the current time (UTC)."""
    return datetime.now(UTC)


def now() -> str:
    """Return the current time in ISO 8601, as in manifests."""
    return current_time().isoformat(timespec="seconds")
