"""Download of data sets into the user's cache, with a checksum for each file."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

from wavetank.base.cache import writable
from wavetank.base.columns import read_columns
from wavetank.base.errors import InputError, WavetankError
from wavetank.data.description import DATASET, DataFile, Dataset
from wavetank.data.places import BUILT_IN, PART, dataset


def fetch(name: str) -> Path:
    """Download a data set to the user's cache, unless it is there, and return its folder.

    Raises ``InputError`` for an unknown name and for data that must be converted, ``WavetankError`` if no address
    provides a file with the right checksum.
    """
    data = dataset(name)
    if not data.files:
        raise InputError(f"{name}: its files must be converted, as {BUILT_IN / name / DATASET} describes.")
    folder = writable(PART) / name
    download(data, folder)
    return folder


def download(data: Dataset, folder: Path) -> None:
    """Download the files of a data set to ``folder``, and verify them; raise ``WavetankError`` after a failure."""
    for file in data.files:
        if not _intact(folder / file.name, file.sha256):
            _download(file, data.urls, folder)


def _intact(path: Path, sha256: str) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() == sha256


def _download(file: DataFile, urls: tuple[str, ...], folder: Path) -> None:
    import pooch  # slow import

    failures = []
    for address in (url + quote(file.source or file.name) for url in urls):
        try:
            pooch.retrieve(
                address,
                known_hash=None if file.derived else file.sha256,
                fname=Path(file.source).name if file.derived else file.name,
                path=folder,
                processor=_thinned(file, folder) if file.derived else None,
            )
            return
        except Exception as error:  # any failure of the network; the next address may succeed
            failures.append(f"{address} ({error})")
    raise WavetankError(f"{file.name} could not be downloaded from any of: {'; '.join(failures)}.")


def _thinned(file: DataFile, folder: Path) -> Callable[[str, str, object], str]:
    """Return pooch's processor of a download: write each ``every``-th row to ``file.name``, delete the source."""

    def thin(downloaded: str, action: str, pup: object) -> str:
        try:
            t, eta = read_columns(Path(downloaded)).values.T
        finally:
            Path(downloaded).unlink()
        path = folder / file.name
        text = "".join(f"{row[0]:.3f} {row[1]:.6e}\n" for row in zip(t[:: file.every], eta[:: file.every], strict=True))
        path.write_bytes(text.encode())
        if not _intact(path, file.sha256):
            path.unlink()
            raise ValueError(f"each {file.every}th row of it does not have the known checksum {file.sha256}")
        return str(path)

    return thin
