"""New cases to begin with: commented, complete, and run in seconds."""

import json
import os
from pathlib import Path

from wavetank.case.at_hand import CHECKOUT, SCHEMA
from wavetank.errors import InputError, choice

FOLDER = Path(__file__).with_name("templates")
KINDS = ("slice", "basin", "ring", "focus")


def write_case(name: str, kind: str) -> Path:
    """Write ``NAME.toml`` and return its path; raises ``InputError`` where it is there already, or cannot be written.

    Parameters
    ----------
    name
        Path of the case, with or without its ending.
    kind
        One of ``KINDS``.
    """
    if kind not in KINDS:
        raise InputError(f"--kind {kind} received{choice(kind, KINDS)}.")
    if not Path(name).name:
        raise InputError(f"{name!r} received; a name for the case is needed, such as waves.")
    path = Path(name).with_name(f"{Path(name).name.removesuffix('.toml')}.toml")
    text = (FOLDER / f"{kind}.toml").read_text(encoding="utf-8").replace("TITLE", json.dumps(path.stem))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(f"#:schema {_schema(path.resolve().parent)}\n{text}")
    except FileExistsError:
        raise InputError(f"{path}: is there already; give another name.") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from None
    return path


def _schema(folder: Path) -> str:
    """Return how a case in a folder names the schema: within a checkout by the way from there."""
    return os.path.relpath(SCHEMA, folder) if folder.is_relative_to(CHECKOUT) else str(SCHEMA)
