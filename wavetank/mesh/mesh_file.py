"""A mesh from a file."""

from typing import Literal

from pydantic import Field

from wavetank.values.noun import FilePath, Noun


class MeshFile(Noun):
    """A mesh in the plane z = 0, with the physical groups ``paddle``, ``wall`` and, if it has one, ``sponge``."""

    type: Literal["file"] = "file"
    file: FilePath = Field(description="mesh file, gmsh's .msh or what meshio reads")

    @property
    def box(self) -> None:
        """Not known before the file is read."""
        return None
