"""Measured and published data: descriptions, folders and records.

A data set is a folder with a ``dataset.toml`` (``description.py``), which describes its files. The descriptions of a
few benchmarks are in this package (``known/``): facts, addresses and checksums, without the data.
"""

from wavetank.data.description import DATASET, DataFile, Dataset, Section, WaveHeights, corrected
from wavetank.data.downloading import download, fetch
from wavetank.data.places import dataset, find, folders, names, opened, other_columns, resolve, summary, units_note
from wavetank.data.series import HeightSeries, gauge_records, height_series
from wavetank.data.tables import gauges_header
