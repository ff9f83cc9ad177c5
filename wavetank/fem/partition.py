"""How cells are given to ranks."""

from typing import Any

from dolfinx import mesh


def cell_partitioner() -> Any:
    """Return dolfinx's partitioner that gives each rank its cells and their neighbours across facets."""
    mode = mesh.GhostMode.shared_facet
    try:
        return mesh.create_cell_partitioner(mode, max_facet_to_cell_links=2)
    except TypeError:  # up to dolfinx 0.10
        return mesh.create_cell_partitioner(mode)
