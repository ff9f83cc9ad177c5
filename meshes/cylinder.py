"""Mesh a basin around a cylinder: triangles with curved sides, small at the cylinder.

./env python meshes/cylinder.py cylinder.msh
"""

import sys

import gmsh

length, width, x, y, radius, size, smallest = 6.0, 3.5, 2.4, 1.75, 0.5, 0.3, 0.12  # m, the last two of cells

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
cad = gmsh.model.occ
basin, column = cad.addRectangle(0, 0, 0, length, width), cad.addDisk(x, y, 0, radius, radius)
cad.cut([(2, basin)], [(2, column)])
cad.synchronize()

paddle = gmsh.model.getEntitiesInBoundingBox(-1e-6, -1e-6, -1e-6, 1e-6, width + 1e-6, 1e-6, dim=1)
edge = gmsh.model.getBoundary([(2, basin)], oriented=False)
gmsh.model.addPhysicalGroup(1, [curve for _, curve in paddle], name="paddle")
gmsh.model.addPhysicalGroup(1, [curve for _, curve in edge if (1, curve) not in paddle], name="wall")
gmsh.model.addPhysicalGroup(1, [curve for _, curve in edge if gmsh.model.getType(1, curve) != "Line"], name="cylinder")
gmsh.model.addPhysicalGroup(2, [basin], name="water")

distance = f"Sqrt((x - {x})^2 + (y - {y})^2) - {radius}"
field = gmsh.model.mesh.field.add("MathEval")
gmsh.model.mesh.field.setString(field, "F", f"{smallest} + 0.2 * ({distance})")  # cells grow away from the cylinder
gmsh.model.mesh.field.setAsBackgroundMesh(field)
gmsh.option.setNumber("Mesh.MeshSizeMax", size)
gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
gmsh.model.mesh.generate(2)
gmsh.model.mesh.setOrder(2)  # sides that follow the circle
gmsh.write(sys.argv[1])
gmsh.finalize()
