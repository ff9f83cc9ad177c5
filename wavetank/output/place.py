"""Where a command writes: never over what is there, unless told."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from wavetank.errors import InputError


@dataclass(frozen=True)
class Place:
    """A folder to write to.

    Attributes
    ----------
    path
        The folder.
    numbered
        Whether path-2, path-3, ... will do where it is taken: a default of which nobody has asked for that very one.
    overwrite
        Whether what is there may be replaced.
    """

    path: Path
    numbered: bool = False
    overwrite: bool = False

    @classmethod
    def of(cls, out: Path | None, default: Path, *, overwrite: bool) -> "Place":
        """Return the place that is asked for, or a default, numbered unless it may be overwritten."""
        return cls(out or default, numbered=out is None and not overwrite, overwrite=overwrite)

    @property
    def candidates(self) -> Iterator[Path]:
        """The path, and where it may be numbered all that follow."""
        yield self.path
        if self.numbered:
            yield from (self.path.with_name(f"{self.path.name}-{n}") for n in count(2))

    def folder(self) -> Path:
        """Return the folder, made if missing; raise ``InputError`` if it has files that must not be replaced."""
        for path in self.candidates:
            try:
                path.mkdir(parents=True, exist_ok=True)
                if self.overwrite or not any(path.iterdir()):
                    return path
            except OSError as error:
                raise InputError(f"{path}: cannot be written ({error.strerror}).") from None
        raise InputError(f"{self.path}: holds files already; give a new folder, or --overwrite.")


def check_new(*files: Path, overwrite: bool) -> None:
    """Raise ``InputError`` for a file that is there and must not be replaced."""
    for file in files:
        if file.exists() and not overwrite:
            raise InputError(f"{file}: is there already; give another name, or --overwrite.")
