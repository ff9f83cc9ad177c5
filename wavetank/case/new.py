"""Cases in the checkout and the current directory, and new cases from templates."""

import json
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path

from wavetank.base.errors import InputError, choice, write_errors
from wavetank.base.files import regular

# ---------------------------------------------------------------- existing cases
CHECKOUT = Path(__file__).resolve().parents[2]
SCHEMA = Path(__file__).with_name("schema.json")  # schema of this version, named in the first line of cases
REQUIRED_TABLES = {"tank", "run"}  # tables that every case has


def cases_at_hand() -> Iterator[tuple[Path, str]]:
    """Yield path and title of each case in cases/ of the checkout, in ./cases and in the current directory, once."""
    listed = set[Path]()
    for folder in (CHECKOUT / "cases", Path("cases"), Path()):
        for path in sorted(folder.glob("*.toml")):
            title = None if path.resolve() in listed else _title(path)
            if title is not None:
                listed.add(path.resolve())
                path, here = path.resolve(), Path.cwd()
                yield path.relative_to(here) if path.is_relative_to(here) else path, title


def _title(path: Path) -> str | None:
    """Return the title of a case; None for a file that is not a case."""
    try:
        content = tomllib.loads(regular(path).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None
    return str(content.get("title", "")) if content.keys() >= REQUIRED_TABLES else None


# ---------------------------------------------------------------- new cases
FOLDER = Path(__file__).with_name("templates")
KINDS = ("slice", "basin", "ring", "focus")


def write_case(name: str, kind: str) -> Path:
    """Write ``NAME.toml`` and return its path; raises ``InputError`` if it exists or cannot be written.

    Parameters
    ----------
    name
        Path of the case, with or without its suffix.
    kind
        One of ``KINDS``.
    """
    if kind not in KINDS:
        raise InputError(f"--kind {kind} received{choice(kind, KINDS)}.")
    if not Path(name).name:
        raise InputError(f"{name!r} received; a name for the case is needed, such as waves.")
    path = Path(name).with_name(f"{Path(name).name.removesuffix('.toml')}.toml")
    text = (FOLDER / f"{kind}.toml").read_text(encoding="utf-8").replace("TITLE", json.dumps(path.stem))
    if path.exists():
        raise InputError(f"{path}: is there already; give another name.")
    with write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            folder = path.resolve().parent
            schema = os.path.relpath(SCHEMA, folder) if folder.is_relative_to(CHECKOUT) else SCHEMA
            file.write(f"#:schema {schema}\n{text}")
    return path
