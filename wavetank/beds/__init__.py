"""Beds: still-water depth d(x, y) from measured data; a ``Formula`` is one as it is.

A bed is a callable: places x, y [m], each of shape (N,), to d [m], shape (N,). Knows nothing of finite elements.
"""

from wavetank.beds.bed_file import Positive, read_bed
from wavetank.beds.gridded import Gridded, Interpolation
from wavetank.beds.survey import Survey
