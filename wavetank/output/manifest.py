"""The schema of a manifest: types of the keys that are read; further keys are allowed.

A case is validated as such when a run is resumed (``case/``). The schema has the keys of a case that figures,
comparisons and analyses use, also for runs of other versions of this program.
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
from types import GenericAlias
from typing import Any

from pydantic import AwareDatetime, ConfigDict, ValidationError, create_model

from wavetank.base.errors import InputError, printable
from wavetank.output.files import open_regular

MANIFEST = "manifest.json"
MAX_SIZE = 10**8  # largest size of a manifest that is read [bytes]


def _object(*required: str, **types: Any) -> Any:
    """Return the model of a JSON object with values of these types; keys except the required ones may be missing.

    Further keys are allowed, numbers are finite, and no type is converted.
    """
    fields: dict[str, Any] = {key: (kind, ... if key in required else None) for key, kind in types.items()}
    return create_model("Object", __config__=ConfigDict(strict=True, allow_inf_nan=False), **fields)


NUMBER, TEXT = float | None, str | None
NUMERICS = _object(order=int | None, dt=NUMBER)
WALL = _object(type=TEXT, motion=_object(type=TEXT, period=NUMBER, frequency=NUMBER) | None)
TANK = _object(
    type=TEXT, depth=NUMBER, length=NUMBER, gravity=float, density=float, layout=_object(length=NUMBER) | None
)
CASE = _object(
    title=str,
    tank=TANK,
    wall=WALL,
    far_wall=WALL | None,
    sponge=_object("type", type=str, length=NUMBER) | None,
    gauge_lines=GenericAlias(list, (_object("name", name=str),)),
    run=_object("duration", duration=float) | None,
    numerics=NUMERICS,
)
WARNING = _object(
    *("code", "message"),
    code=str,
    message=str,
    key=str,
    **dict.fromkeys(("value", "limit", "t", "x", "y", "until"), NUMBER),
    details=dict[str, float | str],
)
STEEP_CREST = _object("x", "height", "speed_ratio", x=float, height=float, speed_ratio=float)
CRESTS = GenericAlias(list, (STEEP_CREST,))
BREAKDOWN = _object("t", "steepest", "crests", t=float, steepest=dict[str, float], crests=CRESTS)
MANIFEST_CONTENT = _object(
    status=str,
    id=TEXT,
    host=TEXT,
    git=TEXT,
    started=str,
    written=AwareDatetime | None,
    cause=str,
    command=list[str],
    warnings=GenericAlias(list, (WARNING | str,)),  # sentences in older manifests
    versions=dict[str, str],
    files=dict[str, str],
    case=CASE,
    planned=_object(numerics=NUMERICS) | None,
    progress=_object(t=float, begin=float, end=NUMBER, wall_s=float),
    numerics=NUMERICS,
    timings=dict[str, float],
    counters=dict[str, int],
    memory=dict[str, float],
    highest_crest=_object("height", "x", "t", height=float, x=float, t=float) | None,
    broke_down=BREAKDOWN | None,
    breaking=_object(waves=int),
    certificate=_object(resolved=bool, reason=str),
)


def read_manifest(run: Path) -> dict[str, Any]:
    """Return the manifest of a run directory; raise ``InputError`` if it is missing or has a value of a wrong type."""
    try:
        with open_regular(run / MANIFEST) as file:
            if os.fstat(file.fileno()).st_size > MAX_SIZE:
                raise _missing(run)
            content = file.read()
        manifest: dict[str, Any] = json.loads(content)
        MANIFEST_CONTENT.model_validate_json(content)
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
    """Return the program of a run: versions, host, command and git revision."""
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
    """Return the revision of the checkout, marked if it is modified; None outside a checkout."""
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
