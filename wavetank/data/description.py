"""The content of a ``dataset.toml``: a description of the files in its folder."""

import tomllib
from collections import Counter
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_args

from pydantic import BeforeValidator, Field, Strict, ValidationError, field_validator, model_validator
from pydantic_core import ErrorDetails

from wavetank.base.case_model import CaseModel, Problem
from wavetank.base.errors import InputError
from wavetank.base.files import regular
from wavetank.base.quantities import Coordinate, Height, Label, Pair

DATASET = "dataset.toml"
MEASURED = "measured"
FREE = (-inf, inf)
AXES = {"x": 0, "y": 1}  # index in a position (x, y)
SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0}
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


def _column(received: Any) -> Any:
    if isinstance(received, str) or (type(received) is int and received >= 1):
        return received
    raise ValueError("must be a column's number, from 1, or its name in the file's first line")


def _clock(received: Any) -> Any:
    """Return the least and the largest offset [s]."""
    if received == "free":
        return FREE
    bounds = received if isinstance(received, list | tuple) else [received, received]
    numbers = [float(one) for one in bounds if type(one) in (int, float) and isfinite(one)]
    if len(numbers) == len(bounds) == 2 and numbers[0] <= numbers[1]:
        return tuple(numbers)
    raise ValueError("must be 'free', a number of seconds, or [smallest, largest]")


def _file(name: str) -> str:
    if name.startswith("/") or any(part in ("", ".", "..") or "\0" in part for part in name.split("/")):
        raise ValueError("must be a file in the folder of the data, or below")
    return name


Model = TypeVar("Model", bound=CaseModel)
Column = Annotated[int | str, BeforeValidator(_column)]
Bound = Annotated[float, Field(allow_inf_nan=True)]
Clock = Annotated[tuple[Bound, Bound], Strict(False), BeforeValidator(_clock)]
FileName = Annotated[str, BeforeValidator(_file)]
Expanded = Annotated[float, Field(ge=0, le=1e6)]  # expanded uncertainty at a confidence of 95 %


class DataFile(CaseModel):
    """A file that can be downloaded."""

    name: FileName = Field(description="its name here")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="its checksum")
    source: str = Field(default="", description="its name at the source, if that differs")
    every: int = Field(default=1, ge=1, description="which rows of the source it keeps: 20 for each twentieth")

    @property
    def derived(self) -> bool:
        """Whether the file is made from that of the source."""
        return self.every > 1


class RecordUncertainty(CaseModel):
    """Expanded uncertainties of a measured record at a confidence of 95 %."""

    gain: Expanded | None = Field(default=None, description="relative uncertainty of its values")
    clock: Expanded | None = Field(default=None, description="of its times [s]")

    @property
    def stated(self) -> dict[str, float]:
        """The stated parts by name."""
        return self.model_dump(include={"gain", "clock", "place", "noise"}, exclude_none=True)

    @property
    def unstated(self) -> list[str]:
        """The names of the other parts."""
        return [name for name, size in self if size is None]


class GaugeUncertainty(RecordUncertainty):
    """Expanded uncertainties of the record of a gauge at a confidence of 95 %."""

    place: Expanded | None = Field(default=None, description="of its distance from the paddle [m]")
    noise: Expanded | None = Field(default=None, description="of each elevation, independent of the others [m]")


class PaddleUncertainty(RecordUncertainty):
    """Expanded uncertainties of a record that drives the paddle at a confidence of 95 %."""

    noise: Expanded | None = Field(default=None, description="of each value, independent [the unit of the record]")
    file: FileName = Field(description="the record")


class GaugePosition(CaseModel):
    """A position with a record of the elevation."""

    name: Label = Field(description="what it is called")
    x: Coordinate | None = Field(default=None, description="distance from the paddle's rest position [m]")
    y: Coordinate = Field(default=0.0, description="distance across the tank [m]")
    uncertainty: GaugeUncertainty = Field(
        default=GaugeUncertainty(), description="of its record; replaces those of all gauges"
    )


class Units(CaseModel):
    """Units of the numbers in a file."""

    time: Literal["s", "ms", "min"] = "s"
    elevation: Literal["m", "cm", "mm"] = "m"


class RecordFiles(CaseModel):
    """Elevations at all gauges of a data set from one origin."""

    source: Label = Field(default=MEASURED, description="where they come from, for legends")
    citation: str = Field(default="", description="what to cite")
    files: Annotated[tuple[FileName, ...], Strict(False)] = Field(
        min_length=1, description="one file for all gauges, or one for each, in their order"
    )
    time: Column = Field(default=1, description="column of the times")
    columns: Annotated[tuple[Column, ...], Strict(False)] = Field(
        default=(), description="column of each gauge; default: that of its name, else the next"
    )
    units: Units = Units()
    gains: Annotated[tuple[float, ...], Strict(False)] = Field(
        default=(), description="what each gauge's elevations are to be multiplied by; default 1"
    )
    clocks: Annotated[tuple[float, ...], Strict(False)] = Field(
        default=(), description="what is to be added to each gauge's times [s]; default 0"
    )
    clock_offset: Clock = Field(
        default=(0.0, 0.0), description="what is to be added to the times [s]: a number, [smallest, largest], or 'free'"
    )


class ComputedFiles(RecordFiles):
    """Elevations of a computation in a data set with measured ones, whose uncertainties are not its own."""


class Section(CaseModel):
    """A straight line through a tank, parallel to an axis, with wave heights."""

    name: Label = Field(description="what it is called")
    along: Literal["x", "y"] = Field(description="the axis it runs along")
    at: Coordinate = Field(description="the other coordinate [m]")
    reach: Pair = Field(description="where it begins and ends on its axis [m]")

    @property
    def across(self) -> str:
        """The axis of the constant coordinate."""
        return next(axis for axis in AXES if axis != self.along)

    def coordinates(self, x: float, y: float) -> tuple[float, float]:
        """Return the coordinate of (x, y) along the line, and the distance from the line [m]."""
        place = (x, y)
        return place[AXES[self.along]], place[AXES[self.across]] - self.at


class HeightColumn(CaseModel):
    """The column of a file with the wave heights along a section."""

    section: Label = Field(description="the section's name")
    file: FileName = Field(description="the file; its first column is the place along the section's axis [m]")
    column: Column = Field(default=2, description="column of the heights")
    sign: Literal[-1, 1] = Field(default=1, description="-1 where the file counts its places against the axis")


class HeightRecords(CaseModel):
    """Wave heights along sections from one origin."""

    source: Label = Field(default=MEASURED, description="where they come from, for legends")
    citation: str = Field(default="", description="what to cite")
    incident: float = Field(gt=0, description="what stands in the columns for the incident wave's height")
    columns: Annotated[tuple[HeightColumn, ...], Strict(False)] = Field(description="where each section's heights are")


class WaveHeights(CaseModel):
    """Wave heights along sections."""

    incident_height: Height = Field(description="H0 [m], which the heights are given in parts of")
    incident: Section = Field(description="where that wave still is as the paddle made it")
    start: float = Field(ge=0, description="when the waves are established [s]")
    sections: Annotated[tuple[Section, ...], Strict(False)]
    records: Annotated[tuple[HeightRecords, ...], Strict(False)]


class Dataset(CaseModel):
    """A data set; its first records are the reference of comparisons."""

    name: Label = Field(default="", description="what it is called; default: as its folder")
    title: Label = Field(default="", description="one line on what it is")
    citation: str = Field(default="", description="what to cite")
    licence: str = Field(default="", description="on what terms it is given")
    urls: Annotated[tuple[str, ...], Strict(False)] = Field(
        default=(), description="public addresses of the folder, tried in this order"
    )
    gauges: Annotated[tuple[GaugePosition, ...], Strict(False)] = ()
    records: Annotated[tuple[RecordFiles, ...], Strict(False)] = ()
    uncertainty: GaugeUncertainty = Field(
        default=GaugeUncertainty(), description="of the records of all gauges, expanded, at a confidence of 95 %"
    )
    paddle: Annotated[tuple[PaddleUncertainty, ...], Strict(False)] = Field(
        default=(), description="records that drive the paddle, with their uncertainties"
    )
    heights: WaveHeights | None = None
    files: Annotated[tuple[DataFile, ...], Strict(False)] = Field(default=(), description="what can be downloaded")
    folder: Path = Field(default=Path(), description="where its description was read")

    @field_validator("records")
    @classmethod
    def _with_kinds(cls, records: tuple[RecordFiles, ...]) -> tuple[RecordFiles, ...]:
        """Return records, other sources than ``MEASURED`` as ``ComputedFiles`` if there is that one."""
        if MEASURED not in (one.source for one in records):
            return records
        return tuple(one if one.source == MEASURED else ComputedFiles(**dict(one)) for one in records)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names, number = Counter(gauge.name for gauge in self.gauges), len(self.gauges)
        if twice := [name for name, count in names.items() if count > 1]:
            raise ValueError(f"gauges: {twice[0]!r} is the name of several; each must have its own")
        for n, one in enumerate(self.records):
            for key, received, allowed in (
                ("files", len(one.files), {1, number}),
                ("columns", len(one.columns), {0, number}),
                ("gains", len(one.gains), {0, number}),
                ("clocks", len(one.clocks), {0, number}),
            ):
                if received not in allowed:
                    raise ValueError(f"records.{n}.{key}: {received} received; there are {number} gauges")
        if self.heights is not None:
            described = {section.name for section in self.heights.sections}
            for section in (one.section for records in self.heights.records for one in records.columns):
                if section not in described:
                    raise ValueError(f"heights: section {section!r} has heights, and is not one of the sections")
        return self

    def uncertainties(self) -> dict[str, dict[str, float]]:
        """Return the stated expanded uncertainties of the record of each gauge, by its name and that of the part."""
        return {gauge.name: self.uncertainty.stated | gauge.uncertainty.stated for gauge in self.gauges}

    def parts(self) -> list[str]:
        """Return the names of all files that are read, in the order of their mention."""
        heights = self.heights.records if self.heights else ()
        read = [file for one in self.records for file in one.files]
        return list(dict.fromkeys([*read, *(column.file for one in heights for column in one.columns)]))


class Corrections(CaseModel):
    """Corrections of the gauges of a data set, as ``wavetank analyse DATA calibration`` writes them."""

    gauges: Annotated[tuple[GaugePosition, ...], Strict(False)] = Field(min_length=1, description="corrected places")
    gains: Annotated[tuple[float, ...], Strict(False)] = Field(description="factors of the elevations of each gauge")
    clocks: Annotated[tuple[float, ...], Strict(False)] = Field(description="added to the times of each gauge [s]")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not len(self.gauges) == len(self.gains) == len(self.clocks):
            numbers = f"{len(self.gains)} gains and {len(self.clocks)} clocks received"
            raise ValueError(f"{numbers}; there are {len(self.gauges)} gauges")
        return self


def corrected(data: Dataset, path: Path | None) -> Dataset:
    """Return a data set with the corrections of a file; its own gains and clocks apply, too. Others are unchanged.

    The uncertainty of a corrected gain, clock or place is that of the file. Computations are not corrected. Raises
    ``InputError`` for an invalid file, and if no gauge is in the data set.
    """
    if path is None:
        return data
    new = _read(path, Corrections, {}, {})
    rows = {gauge.name: row for gauge, *row in zip(new.gauges, new.gains, new.clocks, strict=True)}
    places = {gauge.name: gauge for gauge in new.gauges}
    names = [gauge.name for gauge in data.gauges]
    if not rows.keys() & set(names):
        raise InputError(f"{path}: gauges {', '.join(rows)} received; {data.name} has {', '.join(names)}.")
    gains, clocks = zip(*(rows.get(name, [1.0, 0.0]) for name in names), strict=True)
    records = []
    for one in data.records:
        own_gains, own_clocks = one.gains or (1.0,) * len(names), one.clocks or (0.0,) * len(names)
        total = {
            "gains": tuple(a * b for a, b in zip(own_gains, gains, strict=True)),
            "clocks": tuple(a + b for a, b in zip(own_clocks, clocks, strict=True)),
        }
        records.append(one if isinstance(one, ComputedFiles) else one.model_copy(update=total))
    stated, gauges = data.uncertainties(), []
    for gauge, gain, clock in zip(data.gauges, gains, clocks, strict=True):
        place = places.get(gauge.name, gauge)
        changed = {"gain": gain != 1.0, "clock": clock != 0.0, "place": (place.x, place.y) != (gauge.x, gauge.y)}
        kept = {part: size for part, size in stated[gauge.name].items() if not changed.get(part)}
        uncertainty = GaugeUncertainty(**kept | place.uncertainty.stated)
        gauges.append(place.model_copy(update={"uncertainty": uncertainty}))
    new_parts = {"gauges": tuple(gauges), "records": tuple(records), "uncertainty": GaugeUncertainty()}
    return data.model_copy(update=new_parts)


def read_dataset(folder: Path) -> Dataset:
    """Return the description of a folder by its ``dataset.toml``.

    Raises ``InputError`` with a line for each error: the file, the key, the received value, what is allowed.
    """
    return _read(folder / DATASET, Dataset, {"name": folder.resolve().name}, {"folder": folder})


def _read(path: Path, model: type[Model], defaults: dict[str, Any], folder: dict[str, Path]) -> Model:
    """Return a TOML file as a model, with defaults and its folder; raise ``InputError`` as ``read_dataset``."""
    try:
        content = tomllib.loads(regular(path).read_text(encoding="utf-8-sig"))
        return model.model_validate(defaults | content | folder)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from None
    except ValidationError as error:
        raise refused(path, error) from None
    except ValueError as error:
        raise InputError(f"{path}: not valid TOML: {error}.") from None


def refused(path: Path, error: ValidationError) -> InputError:
    """Return the errors of a description or a table, one line each."""
    model = globals().get(error.title)
    return InputError("\n".join(f"{path}: {_sentence(one, model)}." for one in error.errors(include_url=False)))


def _sentence(details: ErrorDetails, model: type[CaseModel] | None) -> str:
    """Return the meaning of an error of pydantic in a model of this module, None for others."""
    if not details["loc"]:
        return str(details["ctx"]["error"])
    if details["type"] == "missing":
        return str(Problem(details["loc"], None, "is missing"))
    allowed = details["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    if details["type"] == "extra_forbidden":
        allowed = f"is no key{_keys(model, details['loc'][:-1])}"
    if details["type"] == "model_type":
        allowed = f"must be a table of {', '.join(globals()[details['ctx']['class_name']].model_fields)}"
    if details["type"] == "tuple_type":
        allowed = "must be a list, [...]"
    return str(Problem(details["loc"], details["input"], allowed))


def _keys(model: type[CaseModel] | None, place: tuple[int | str, ...]) -> str:
    """Return the keys that are allowed at a place of a model, at the end of a message; empty without a model."""
    for part in place:
        if model and isinstance(part, str):
            annotation = model.model_fields[part].annotation
            parts = [annotation, *get_args(annotation)]
            model = next((one for one in parts if isinstance(one, type) and issubclass(one, CaseModel)), None)
    return f"; allowed are {', '.join(model.model_fields)}" if model else ""
