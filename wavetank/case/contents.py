"""What is in the files that a scene names: a file may change and keep its name."""

import hashlib
from collections.abc import Iterator
from contextlib import suppress
from math import inf
from pathlib import Path

from wavetank import data
from wavetank.errors import InputError
from wavetank.values.files import regular
from wavetank.values.noun import Located, Noun


def contents(scene: Noun) -> dict[str, str]:
    """Return the SHA-256 of each file that a scene names and that is there, by its dotted key."""
    found = {}
    for key, reference in named_files(scene):
        with suppress(InputError, OSError), regular(data.resolve(reference, Path()), largest=inf).open("rb") as file:
            found[key] = hashlib.file_digest(file, "sha256").hexdigest()
    return found


def named_files(noun: Noun, *keys: str) -> Iterator[tuple[str, str]]:
    """Yield by which dotted keys a noun, which stands there, and those in it name files, and how."""
    for name, value in noun:
        if isinstance(value, Located):
            yield ".".join((*keys, name)), value
        elif isinstance(value, Noun):
            yield from named_files(value, *keys, name)
