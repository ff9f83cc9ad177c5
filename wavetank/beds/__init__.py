"""Beds: still-water depth d(x, y) by a function in Python or from gridded data; a ``Formula`` is one as it is.

A bed is a callable: places x, y [m], each of shape (N,), to d [m], shape (N,). Knows nothing of finite elements.
"""

from wavetank.beds.grid_file import Positive, read_grid
from wavetank.beds.gridded import Gridded, Interpolation
from wavetank.beds.python_file import PythonDepth, load

__all__ = ["Gridded", "Interpolation", "Positive", "PythonDepth", "load", "read_grid"]
