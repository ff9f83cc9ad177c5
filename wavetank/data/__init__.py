"""Measured and published data: descriptions, folders and records.

A set of data is a folder with a ``dataset.toml`` (``description.py``) that says what its files hold. Those of a few
benchmarks come with this package (``known/``): facts, addresses and checksums, for the data are not part of it.
"""

from wavetank.data.description import DATASET, DataFile, Dataset, Section, WaveHeights
from wavetank.data.downloading import download, fetch
from wavetank.data.places import dataset, find, folders, names, opened, resolve, summary, units_note
from wavetank.data.series import HeightSeries, gauge_records, height_series
