"""What a run should be reproducible from."""

import platform
import subprocess
import sys
from contextlib import suppress
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any


def environment() -> dict[str, Any]:
    """Return what a run should be reproducible from: versions, host, command and git revision."""
    return {
        "versions": {"python": platform.python_version(), **_versions()},
        "host": platform.node(),
        "system": platform.platform(),
        "command": sys.argv,
        "git": _revision(),
        "started": now(),
    }


def _versions() -> dict[str, str]:
    """Return the version of each library the numbers rest on, of those that are here."""
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
        answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return answer.stdout.strip() or None


def present() -> datetime:
    """Return the present, as this machine's clock has it."""
    return datetime.now(UTC)


def now() -> str:
    """Return the present, as manifests tell it."""
    return present().isoformat(timespec="seconds")
