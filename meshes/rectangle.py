"""Mesh a rectangular basin of quadrilaterals: paddle at x = 0, sponge in the last metres.

./env python meshes/rectangle.py rectangle.msh
"""

import sys

import gmsh

length, width, sponge, size = 6.0, 3.5, 1.5, 0.25  # m, the last of cells

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
cad = gmsh.model.occ
parts = cad.addRectangle(0, 0, 0, length - sponge, width), cad.addRectangle(length - sponge, 0, 0, sponge, width)
cad.fragment([(2, parts[0])], [(2, parts[1])])  # both share the line between them
cad.synchronize()

paddle = gmsh.model.getEntitiesInBoundingBox(-1e-6, -1e-6, -1e-6, 1e-6, width + 1e-6, 1e-6, dim=1)
edge = gmsh.model.getBoundary([(2, part) for part in parts], combined=True, oriented=False)
gmsh.model.addPhysicalGroup(1, [curve for _, curve in paddle], name="paddle")
gmsh.model.addPhysicalGroup(1, [curve for _, curve in edge if (1, curve) not in paddle], name="wall")
gmsh.model.addPhysicalGroup(2, parts[:1], name="water")
gmsh.model.addPhysicalGroup(2, parts[1:], name="sponge")

for dim, curve in gmsh.model.getEntities(1):
    cells = round(cad.getMass(dim, curve) / size)
    gmsh.model.mesh.setTransfiniteCurve(curve, cells + 1)
for part in parts:  # rows and columns of quadrilaterals
    gmsh.model.mesh.setTransfiniteSurface(part)
    gmsh.model.mesh.setRecombine(2, part)
gmsh.model.mesh.generate(2)
gmsh.write(sys.argv[1])
gmsh.finalize()
