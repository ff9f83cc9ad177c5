"""Layouts of basins, drawn by gmsh or read from a file, and bathymetry: still-water depth d(x, y) from measured data.

A bathymetry is a function of positions x, y [m], shape (N,) each, that returns d [m], shape (N,), such as a
``Formula``.
"""

from typing import Annotated

from pydantic import Field

from wavetank.mesh.bathymetry import Gridded, Interpolation, Positive, Survey, read_bed
from wavetank.mesh.layouts import Bend, Cylinder, Harbour, MeshFile, Rectangle

Layout = Annotated[Rectangle | Cylinder | Bend | Harbour | MeshFile, Field(discriminator="type")]
