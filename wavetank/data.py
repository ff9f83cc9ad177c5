"""Benchmark data: where it is found and downloaded from, and what it holds: gauges' records, wave heights.

A file of a data set is looked for in ``$WAVETANK_DATA/NAME``, in ``../shared/data/NAME`` beside the checkout, and in
the user's cache, to which ``fetch`` downloads. The data are not part of this project: the registry holds addresses and
checksums only.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import quote

import numpy as np
import pooch
from numpy.typing import NDArray

from wavetank.cache import places, writable
from wavetank.errors import InputError, WavetankError
from wavetank.motions.record_file import read_record
from wavetank.records.series import GaugeSeries

MEASURED = "measured"
AXES = {"x": 0, "y": 1}  # of a place (x, y)


@dataclass(frozen=True)
class DataFile:
    """A file of a data set.

    Attributes
    ----------
    name
        Its name here.
    sha256
        Its checksum.
    source
        Its name at the source, if that differs.
    every
        Which rows of the source it keeps: 1 for the file as it is, 20 for each twentieth row (a *derived* file).
    """

    name: str
    sha256: str
    source: str = ""
    every: int = 1

    @property
    def address(self) -> str:
        """Its path below the source's address, quoted for a URL."""
        return quote(self.source or self.name)

    @property
    def derived(self) -> bool:
        """Whether the file is made from the source's instead of being it."""
        return self.every > 1


@dataclass(frozen=True)
class GaugeRecords:
    """Elevations at all gauges of a data set from one origin.

    Attributes
    ----------
    source
        Where they come from, for legends.
    files
        One file a gauge, in the gauges' order: time [s], elevation [m].
    citation
        What to cite.
    """

    source: str
    files: tuple[str, ...]
    citation: str


@dataclass(frozen=True)
class Section:
    """A straight line through a tank, parallel to an axis, along which wave heights are known.

    Attributes
    ----------
    name
        What it is called, e.g. ``"3"``.
    along
        The axis it runs along.
    at
        The other coordinate [m].
    reach
        Where it begins and ends on its axis [m].
    """

    name: str
    along: Literal["x", "y"]
    at: float
    reach: tuple[float, float]

    @property
    def across(self) -> str:
        """The axis of the coordinate that is the same all along it."""
        return next(axis for axis in AXES if axis != self.along)

    def coordinates(self, x: float, y: float) -> tuple[float, float]:
        """Return how far along its axis a place (x, y) is, and how far beside the line [m]."""
        place = (x, y)
        return place[AXES[self.along]], place[AXES[self.across]] - self.at


@dataclass(frozen=True)
class HeightColumn:
    """Where wave heights along a section stand: a column of numbers of a text file, beside that of the places.

    Attributes
    ----------
    section
        The section's name.
    file
        The file; its first column is the place along the section's axis [m].
    column
        That of the heights, from 0.
    sign
        -1 where the file counts its places against the axis.
    """

    section: str
    file: str
    column: int = 1
    sign: float = 1.0


@dataclass(frozen=True)
class HeightRecords:
    """Wave heights along sections from one origin.

    Attributes
    ----------
    source
        Where they come from, for legends.
    citation
        What to cite.
    unit
        What a one in the columns is in incident wave heights.
    columns
        Where each section's heights are.
    """

    source: str
    citation: str
    unit: float
    columns: tuple[HeightColumn, ...]


@dataclass(frozen=True)
class WaveHeights:
    """Wave heights along sections.

    Attributes
    ----------
    incident_height
        H0 [m], which the heights are given in parts of.
    incident
        Where that wave still is as the paddle made it.
    start
        When the waves are established [s].
    sections
        The sections.
    records
        The heights, of one or several origins.
    """

    incident_height: float
    incident: Section
    start: float
    sections: tuple[Section, ...]
    records: tuple[HeightRecords, ...]


@dataclass(frozen=True)
class HeightSeries:
    """Wave heights along a section, read: places along its axis [m], ascending, and H / H0, both of shape (N,)."""

    section: Section
    places: NDArray[np.float64]
    ratios: NDArray[np.float64]
    source: str


@dataclass(frozen=True)
class Dataset:
    """A set of benchmark data.

    Attributes
    ----------
    name
        Its name in ``data:NAME/FILE``.
    title
        One line on what it is.
    urls
        Public addresses of the folder, tried in this order.
    citation, licence
        What to cite, and on what terms the data are given.
    gauges
        Name and distance from the paddle's rest position [m] of each gauge.
    measured
        The measured records.
    published
        Published computations of the same records.
    heights
        Wave heights along sections; None where there are none.
    files
        All files, with checksums.
    """

    name: str
    title: str
    urls: tuple[str, ...]
    citation: str
    licence: str
    gauges: tuple[tuple[str, float], ...] = ()
    measured: GaugeRecords = GaugeRecords(MEASURED, files=(), citation="")
    published: tuple[GaugeRecords, ...] = ()
    heights: WaveHeights | None = None
    files: tuple[DataFile, ...] = field(default=(), repr=False)


_MARIN = Dataset(
    name="marin-202002",
    title="Focusing wave made by a measured piston in a tank of 1 m depth, 120 s, six gauges (MARIN test case 202002)",
    urls=(
        "https://raw.githubusercontent.com/EAGRE-water-wave-impact-modelling/3D-wave-tank-JCP2022/HEAD/202002/",
        "https://raw.githubusercontent.com/obokhove/EagreEUEID20202023/c5e2d251de1196f46b5ccdc0db4db97d10b46731/"
        "TCs3Dwavetank2022ff/202002/",
    ),
    citation="T. Bunnik, Benchmark workshop on numerical wave modelling, MARIN report 70022-1-RD, 2010",
    licence="open test case, shared by T. Bunnik and E. Gagarina without a licence file: not redistributed here",
    gauges=(("1", 10.0), ("2", 20.0), ("3", 40.0), ("4", 49.5), ("5", 50.0), ("6", 54.0)),
    measured=GaugeRecords(
        source=MEASURED,
        files=tuple(f"WAVE_{gauge}.dat" for gauge in range(1, 7)),
        citation="MARIN report 70022-1-RD, 2010",
    ),
    published=(
        GaugeRecords(
            source="Gagarina et al. 2014",
            files=tuple(f"gagarina2014_probe{gauge}.dat" for gauge in range(1, 7)),
            citation="E. Gagarina et al., J. Comput. Phys. 275 (2014), doi:10.1016/j.jcp.2014.06.035",
        ),
    ),
    files=(
        DataFile("PistonMotion.dat", "1c2104c6d0fdb101542da004d47980e22f8118afd660f7c95e043549861008ee"),
        DataFile("PistonVelocity.dat", "7b563be2ba386eab788dfed4df6bcd9970e5cea109beec69320f72829873c906"),
        DataFile("PistonAcceleration.dat", "65fd1d9916353d15d9acc4a998117cd215cb2c2eac4ebe4c2794d43831c36358"),
        DataFile("WAVE_1.dat", "effb2116a0ff5528c09bb2814a75571bf10b6c8bda88a2509aa9e42bad33db07"),
        DataFile("WAVE_2.dat", "4ae1add00137cff929c667454dcc2a91ac63d2f6c0b7f901d9e2277784dd6d39"),
        DataFile("WAVE_3.dat", "9686414b26ac4d3dd4579adc7e0ef04c7a34be0ddfed5a04774650089f962452"),
        DataFile("WAVE_4.dat", "8d9134053f98629d1f718d9b1b84bb8be63ee71b11573ce92be88b68b22ca34f"),
        DataFile("WAVE_5.dat", "4b3c3b327624a7e22d662f84b21c9acf81780c5a2cca7cbf94f44005bda48dba"),
        DataFile("WAVE_6.dat", "3e9b483540824cd9c4dd367d02da86d02e0be3b304e0ec099f65f858aba4ccb8"),
        *(
            DataFile(f"gagarina2014_probe{gauge}.dat", sha256, source=f"wavemaker202002 {gauge - 1}.dat", every=20)
            for gauge, sha256 in enumerate(
                (
                    "7b3d9bf911250e9dea0bfc552637e3ddf65614b2c19d29d3ffa59f4777dd119a",
                    "59a99748cb398f114bd61781b48d5f59cc8561b4fed45a836ec8d14d248e5c11",
                    "8e8540a8b3e24a0c738149e466113fadeea83dd1cbfed81742eb6833de6177b2",
                    "f19f3f6283d12d4e363416f2d293007280c9183060ce81e3b18c600654d24c5e",
                    "0218fca603a770e1932be714e223b68fd622e76f6be3a442e33c88a91b8846cc",
                    "08f704b8407dcf09d6161e983f806acd20fd490271c074c9b5b3400f0fa3071f",
                ),
                start=1,
            )
        ),
    ),
)

_NHWAVE = "JimKirby/NHWAVE/e287ea6fd717eb1dc1a1ad6fb5d0778a4cd31e99/examples/berkhoff/postprocessing"
_BASILISK = "comphy-lab/basilisk-C/c7be0ade/basilisk-source/src/examples"
_BERKHOFF = Dataset(
    name="berkhoff_1982_shoal",
    title="Berkhoff, Booij and Radder 1982: an elliptic shoal on a slope, wave heights along eight sections",
    urls=("https://raw.githubusercontent.com/",),
    citation="J. C. W. Berkhoff, N. Booij, A. C. Radder, Coastal Eng. 6 (1982), doi:10.1016/0378-3839(82)90022-9",
    licence="digitised points of a published figure, from files of NHWAVE (BSD-2-Clause) and Basilisk (GPL)",
    heights=WaveHeights(
        incident_height=0.0464,
        incident=Section("incident", along="x", at=0.0, reach=(-8.5, -7.0)),  # one wave length, before the slope
        start=30.0,
        sections=(
            *(Section(f"{n}", along="y", at=2.0 * n - 1.0, reach=(-5.0, 5.0)) for n in range(1, 6)),
            *(Section(f"{n}", along="x", at=2.0 * n - 14.0, reach=(0.0, 11.0)) for n in range(6, 9)),
        ),
        records=(
            HeightRecords(
                source="measured (NHWAVE)",
                citation="github.com/JimKirby/NHWAVE, examples/berkhoff",
                unit=1 / 23.2,  # amplitudes in mm
                columns=(
                    *(HeightColumn(f"{n}", f"nhwave_section{n}.dat") for n in range(1, 6)),
                    *(HeightColumn(f"{n}", "nhwave_section678.dat", column=n - 5, sign=-1.0) for n in range(6, 9)),
                ),
            ),
            HeightRecords(
                source="measured (Basilisk)",
                citation="basilisk.fr/src/examples/shoal.c",
                unit=1.0,
                columns=(
                    *(HeightColumn(n, f"basilisk_section-{n}", sign=-1.0) for n in ("2", "3", "5")),
                    HeightColumn("7", "basilisk_section-7"),
                ),
            ),
        ),
    ),
    files=(
        *(
            DataFile(f"nhwave_{file}", sha256, source=f"{_NHWAVE}/{file}")
            for file, sha256 in {
                "section1.dat": "d1f463c9b1540324c80e599e9a3ddc378013ff9de18b899aa1b05e25036e788e",
                "section2.dat": "158a4b5d964b14f4a00040fd40a257fc930c6ac3365ff858485fee702e659e9b",
                "section3.dat": "24231470de50c07946379bf8cd223c697e15f10a467bf353e08592780eb0c98b",
                "section4.dat": "e659df95e57ebe4cebfb9019ce6973ab016a1bd5153afaa0c6b42cf7df6b77a8",
                "section5.dat": "72b1ed4ebac06cc12c7cb223b547203a9a3562095a95ebdc565c5a42f943e167",
                "section678.dat": "a9799ac8cf224a6833f28e04fb4977918c78191539f7b4d558d83fff2baa56e4",
            }.items()
        ),
        *(
            DataFile(f"basilisk_{file}", sha256, source=f"{_BASILISK}/{file}")
            for file, sha256 in {
                "section-2": "9db80e4ab966a32366b11a87e9391702bef9d5fb39d165d17bffb100347143e0",
                "section-3": "c0c31d6880693749c1cab0e4a1483c0d1bc9975782caa6f9b9e35d2162d5e9c3",
                "section-5": "6da139ac73af58d33ff099b28745c53c23f551f2659d7290f30ac5bfc7bbf126",
                "section-7": "6bef16d6cfe25a0cf583e5d424304e4366cd7c6e29fd175de59bfddc17d2ad25",
            }.items()
        ),
    ),
)

PART = "data"  # of the cache
DATASETS: dict[str, Dataset] = {dataset.name: dataset for dataset in (_MARIN, _BERKHOFF)}


def dataset(name: str) -> Dataset:
    """Return the registered data set; raise ``InputError`` for an unknown name."""
    if name not in DATASETS:
        raise InputError(f"data set {name!r} received; known data sets are: {', '.join(sorted(DATASETS))}.")
    return DATASETS[name]


def folders() -> list[Path]:
    """Return the folders in which data sets are looked for, in that order."""
    chosen = os.environ.get("WAVETANK_DATA")
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return [*([Path(chosen)] if chosen else []), beside, *places(PART)]


def find(name: str, file: str) -> Path:
    """Return the path of a data set's file; raise ``InputError`` that says where it was looked for."""
    places = [folder / name / file for folder in folders()]
    for place in places:
        if os.path.isfile(place):  # Path.is_file fails where a folder cannot be entered
            return place
    looked = ", ".join(str(place) for place in places)
    raise InputError(f"data:{name}/{file} is not in any of: {looked}; {_remedy(name, file)}.")


def _remedy(name: str, file: str) -> str:
    if name not in DATASETS:
        return f"set WAVETANK_DATA to the folder that holds {name!r} (known data sets: {', '.join(sorted(DATASETS))})"
    names = [known.name for known in DATASETS[name].files]
    if file not in names:
        return f"the files of {name} are: {', '.join(names)}"
    return f"'wavetank data fetch {name}' downloads it"


def resolve(reference: str, folder: Path) -> Path:
    """Return the path that a case file in ``folder`` means: ``data:NAME/FILE``, or an ordinary path relative to it.

    Raises ``InputError`` if the reference is not of that form or the data are not there.
    """
    scheme, colon, place = reference.partition(":")
    if not (colon and scheme == "data"):
        return (folder / reference).resolve()
    name, *parts = place.split("/")
    if not parts or any(part in ("", ".", "..") or "\0" in part for part in (name, *parts)):
        raise InputError(f"path {reference!r} received; allowed is data:NAME/FILE, a file in the data set's folder.")
    return find(name, "/".join(parts))


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
    return path.is_file() and pooch.file_hash(str(path)) == sha256


def _download(file: DataFile, urls: tuple[str, ...], folder: Path) -> None:
    failures = []
    for url in urls:
        try:
            pooch.retrieve(
                url + file.address,
                known_hash=None if file.derived else file.sha256,
                fname=Path(file.source).name if file.derived else file.name,
                path=folder,
                processor=_thinned(file, folder) if file.derived else None,
            )
            return
        except Exception as error:  # the network has many ways to fail; the next address may do
            failures.append(f"{url + file.address} ({error})")
    raise WavetankError(f"{file.name} could not be downloaded from any of: {'; '.join(failures)}.")


def _thinned(file: DataFile, folder: Path) -> Callable[[str, str, object], str]:
    """Return what pooch calls after a download: keep each ``every``-th row as ``file.name``, drop the source."""

    def thin(downloaded: str, action: str, pup: object) -> str:
        try:
            t, eta = read_record(Path(downloaded))
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


def gauge_series(name: str) -> dict[str, tuple[GaugeSeries, ...]]:
    """Return a data set's records at its gauges by source: ``"measured"`` first, then the published computations.

    A published computation whose files are not there is left out. Raises ``InputError`` for an unknown data set, for
    measurements that are not there and for files that cannot be read.
    """
    data = dataset(name)
    published = [records for records in data.published if _present(name, records)]
    return {records.source: _series(data, records) for records in (data.measured, *published)}


def _present(name: str, records: GaugeRecords) -> bool:
    try:
        return all(find(name, file) for file in records.files)
    except InputError:
        return False


def _series(data: Dataset, records: GaugeRecords) -> tuple[GaugeSeries, ...]:
    return tuple(
        GaugeSeries(gauge, x, *read_record(find(data.name, file)), source=records.source)
        for (gauge, x), file in zip(data.gauges, records.files, strict=True)
    )


def height_series(name: str) -> list[HeightSeries]:
    """Return a data set's wave heights along sections, one origin after the other; none where it has none.

    Raises ``InputError`` for an unknown data set, and for files that are not there or cannot be read.
    """
    heights = dataset(name).heights
    if heights is None:
        return []
    sections = {section.name: section for section in heights.sections}
    return [
        _heights(find(name, column.file), column, records, sections[column.section])
        for records in heights.records
        for column in records.columns
    ]


def _heights(path: Path, column: HeightColumn, records: HeightRecords, section: Section) -> HeightSeries:
    try:
        places, heights = np.loadtxt(path, usecols=(0, column.column), unpack=True, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: a place and a wave height must stand in each row ({error}).") from None
    places = column.sign * places
    ascending = np.argsort(places)
    return HeightSeries(section, places[ascending], records.unit * heights[ascending], source=records.source)
