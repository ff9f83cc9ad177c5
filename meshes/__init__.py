"""Layouts of basins: recipes that gmsh draws, and meshes from files."""

from typing import Annotated

from pydantic import Field

from wavetank.meshes.bend import Bend
from wavetank.meshes.cylinder import Cylinder
from wavetank.meshes.harbour import Harbour
from wavetank.meshes.mesh_file import MeshFile
from wavetank.meshes.rectangle import Rectangle

Layout = Annotated[Rectangle | Cylinder | Bend | Harbour | MeshFile, Field(discriminator="type")]
