"""Draw a mesh with its groups.

./env python meshes/picture.py harbour.msh harbour.png
"""

import sys

import meshio
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

mesh_file, picture = sys.argv[1:]
mesh = meshio.read(mesh_file)
figure = Figure(figsize=(8, 6), layout="constrained")
axes = figure.subplots()
colours = {"water": "lightgrey", "sponge": "tab:green", "wall": "black", "paddle": "tab:red", "cylinder": "tab:blue"}
for name, colour in colours.items():
    for cells in (mesh.cells_dict[kind][rows] for kind, rows in mesh.cell_sets_dict.get(name, {}).items()):
        curves = name in ("wall", "paddle", "cylinder")
        corners = mesh.points[cells[:, :2] if curves else cells[:, : 4 if cells.shape[1] in (4, 9) else 3], :2]
        if curves:
            axes.add_collection(LineCollection(corners, color=colour, lw=3, label=name))
        else:
            axes.add_collection(PolyCollection(corners, facecolor="none", edgecolor=colour, label=name))
axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
axes.autoscale()
figure.legend(loc="outside upper center", ncols=5)
figure.savefig(picture)
