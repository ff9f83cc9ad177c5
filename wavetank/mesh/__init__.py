"""Layouts of basins, which gmsh draws or a file holds, and bathymetry: still-water depth d(x, y) from measured data.

A bathymetry is a callable: places x, y [m], each of shape (N,), to d [m], shape (N,). A ``Formula`` is one as it is.
"""

from typing import Annotated

from pydantic import Field

from wavetank.mesh.bed_file import Positive, read_bed
from wavetank.mesh.bend import Bend
from wavetank.mesh.cylinder import Cylinder
from wavetank.mesh.gridded import Gridded, Interpolation
from wavetank.mesh.harbour import Harbour
from wavetank.mesh.mesh_file import MeshFile
from wavetank.mesh.rectangle import Rectangle
from wavetank.mesh.survey import Survey

Layout = Annotated[Rectangle | Cylinder | Bend | Harbour | MeshFile, Field(discriminator="type")]
