"""The cases at hand: those of the checkout, and those in the present folder."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

from wavetank.values.files import regular

CHECKOUT = Path(__file__).resolve().parents[2]
SCHEMA = Path(__file__).with_name("schema.json")  # of this version, for the first line of cases
NEEDED = {"tank", "run"}  # tables that every case has


def cases_at_hand() -> Iterator[tuple[Path, str]]:
    """Yield path and title of each case in the checkout's cases/, in ./cases and in the present folder, once."""
    seen = set[Path]()
    for folder in (CHECKOUT / "cases", Path("cases"), Path()):
        for path in sorted(folder.glob("*.toml")):
            title = None if path.resolve() in seen else _title(path)
            if title is not None:
                seen.add(path.resolve())
                yield _near(path), title


def _title(path: Path) -> str | None:
    """Return a case's title; None of a file that is no case."""
    try:
        content = tomllib.loads(regular(path).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None
    return str(content.get("title", "")) if content.keys() >= NEEDED else None


def _near(path: Path) -> Path:
    """Return a path as it is typed from the present folder."""
    here, path = Path.cwd(), path.resolve()
    return path.relative_to(here) if path.is_relative_to(here) else path
