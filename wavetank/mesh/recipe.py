"""What a layout is: a recipe by which gmsh draws and meshes it, with named groups.

Curves belong to the groups ``paddle`` and ``wall``, a cylinder's to ``cylinder``, too; surfaces to ``water`` and
``sponge``.
"""

from abc import abstractmethod
from typing import Any, Literal

from pydantic import Field

from wavetank.mesh.gmsh_model import SURFACE
from wavetank.values.noun import Noun
from wavetank.values.quantities import Length, Pair

Box = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max [m]


class Recipe(Noun):
    """A layout that gmsh draws."""

    cells: Literal["quadrilaterals", "triangles"] = Field(default="quadrilaterals", description="shape of the cells")
    geometry: int = Field(default=1, ge=1, le=2, description="order of the cells' geometry: 1 straight, 2 curved")
    sponge_length: float = Field(default=0.0, ge=0, le=1e6, description="length of the group sponge at the far end [m]")

    @property
    @abstractmethod
    def box(self) -> Box:
        """The smallest box around the layout, (x_min, y_min, x_max, y_max) [m]."""

    @property
    def area(self) -> float:
        """Of the layout, about [m²]."""
        left, low, right, high = self.box
        return (right - left) * (high - low)

    def counted(self, cell_size: float) -> tuple[float, float]:
        """Return about how many cells of a size [m] there are, and the size of the smallest [m], without a mesh."""
        return self.area / cell_size**2, cell_size

    @abstractmethod
    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw the layout, its groups and the sizes of its cells into gmsh's current model.

        Parameters
        ----------
        geometry
            The module ``gmsh``.
        cell_size
            To aim at [m].
        """

    def draw(self, cell_size: float) -> None:
        """Draw and mesh the layout into gmsh's current model, cells of about ``cell_size`` [m]."""
        import gmsh  # a scene can be validated without it

        self.outline(gmsh, cell_size)
        if self.cells == "quadrilaterals":
            gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(SURFACE)
        gmsh.model.mesh.setOrder(self.geometry)


class Rectangular(Recipe):
    """A layout between four walls along the axes."""

    length: Length = Field(description="along x [m]")
    width: Length = Field(description="along y [m]")
    origin: Pair = Field(default=(0.0, 0.0), description="the corner of smallest x and y [m]")

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        x, y = self.origin
        return x, y, x + self.length, y + self.width
