"""Downloads data sets, each file with its checksum, into the user's cache."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

from wavetank.base.cache import writable
from wavetank.base.columns import read_columns
from wavetank.base.errors import WavetankError
from wavetank.data.description import DataFile, Dataset
from wavetank.data.places import PART, dataset


def fetch(name: str) -> Path:
    """Download a data set to the user's cache, where not there already, and return its folder.

    Raises ``InputError`` for an unknown name, ``WavetankError`` if a file cannot be had with the right checksum from
    any of its addresses.
    """
    data = dataset(name)
    folder = writable(PART) / name
    download(data, folder)
    return folder


def download(data: Dataset, folder: Path) -> None:
    """Download a data set's files to ``folder``, each checked; raise ``WavetankError`` where that fails."""
    for file in data.files:
        if not _intact(folder / file.name, file.sha256):
            _download(file, data.urls, folder)


def _intact(path: Path, sha256: str) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() == sha256


def _download(file: DataFile, urls: tuple[str, ...], folder: Path) -> None:
    import pooch  # loads long

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
        except Exception as error:  # the network has many ways to fail; the next address may do
            failures.append(f"{address} ({error})")
    raise WavetankError(f"{file.name} could not be downloaded from any of: {'; '.join(failures)}.")


def _thinned(file: DataFile, folder: Path) -> Callable[[str, str, object], str]:
    """Return what pooch calls after a download: keep each ``every``-th row as ``file.name``, drop the source."""

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
