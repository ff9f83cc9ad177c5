"""Layouts of basins, which gmsh draws or a file holds, and bathymetry: still-water depth d(x, y) from measured data.

A bathymetry is a callable: places x, y [m], each of shape (N,), to d [m], shape (N,). A ``Formula`` is one as it is.
"""

from typing import Annotated

from pydantic import Field

from wavetank.mesh.bathymetry import Gridded, Interpolation, Positive, Survey, read_bed
from wavetank.mesh.layouts import Bend, Cylinder, Harbour, MeshFile, Rectangle

Layout = Annotated[Rectangle | Cylinder | Bend | Harbour | MeshFile, Field(discriminator="type")]
