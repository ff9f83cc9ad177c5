"""Measured and published data: what is known of them, where they are, and the records they hold.

A set of data is a folder with a ``dataset.toml`` (``description.py``) that says what its files hold. Those of a few
benchmarks come with this package (``known/``): facts, addresses and checksums, for the data are not part of it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavetank.data.description import DATASET, DataFile, Dataset, Gauge, Records, Section, WaveHeights
    from wavetank.data.downloading import download, fetch
    from wavetank.data.places import dataset, find, folders, names, opened, resolve, told, told_of_units
    from wavetank.data.series import GaugeRecords, HeightSeries, gauge_records, height_series

__all__ = [
    "DATASET",
    "DataFile",
    "Dataset",
    "Gauge",
    "GaugeRecords",
    "HeightSeries",
    "Records",
    "Section",
    "WaveHeights",
    "dataset",
    "download",
    "fetch",
    "find",
    "folders",
    "gauge_records",
    "height_series",
    "names",
    "opened",
    "resolve",
    "told",
    "told_of_units",
]

HOMES = {  # by modules whose own names are none of these: a module, once loaded, is an attribute of its package
    "description": {"DATASET", "DataFile", "Dataset", "Gauge", "Records", "Section", "WaveHeights"},
    "downloading": {"download", "fetch"},
    "places": {"dataset", "find", "folders", "names", "opened", "resolve", "told", "told_of_units"},
    "series": {"GaugeRecords", "HeightSeries", "gauge_records", "height_series"},
}


def __getattr__(name: str) -> Any:
    """Return what is asked for, its module loaded now."""
    for module, names in HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
