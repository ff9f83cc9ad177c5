"""Mesh a channel with a bend: two straight legs and an arc between them, a sponge at the end.

./env python meshes/bend.py bend.msh
"""

import sys
from math import cos, pi, sin

import gmsh

width, first, second, radius, angle, size = 1.0, 2.5, 2.6, 1.0, pi / 3, 0.2  # m and rad, the last of cells
sponge = 1.0  # m, of the second leg

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
cad = gmsh.model.occ
entrance = cad.addLine(cad.addPoint(0, 0, 0), cad.addPoint(0, width, 0))
along = cos(angle), sin(angle)
parts = []  # each is swept from the last line across the channel
across = [(1, entrance)]
for sweep in (
    lambda line: cad.extrude(line, first, 0, 0),
    lambda line: cad.revolve(line, first, width / 2 + radius, 0, 0, 0, 1, angle),
    lambda line: cad.extrude(line, *((second - sponge) * one for one in along), 0),
    lambda line: cad.extrude(line, *(sponge * one for one in along), 0),
):
    swept = sweep(across)
    across, parts = swept[:1], [*parts, swept[1][1]]
cad.synchronize()

edge = gmsh.model.getBoundary([(2, part) for part in parts], combined=True, oriented=False)
gmsh.model.addPhysicalGroup(1, [entrance], name="paddle")
gmsh.model.addPhysicalGroup(1, [curve for _, curve in edge if curve != entrance], name="wall")
gmsh.model.addPhysicalGroup(2, parts[:-1], name="water")
gmsh.model.addPhysicalGroup(2, parts[-1:], name="sponge")

gmsh.option.setNumber("Mesh.MeshSizeMax", size)
gmsh.model.mesh.generate(2)
gmsh.model.mesh.setOrder(2)  # sides that follow the arc
gmsh.write(sys.argv[1])
gmsh.finalize()
