"""Mesh a fairway with an arm at its far end; the sponge is the end of the arm.

./env python meshes/harbour.py harbour.msh
"""

import sys

import gmsh

length, width, arm_length, arm_width, sponge, size = 5.0, 1.2, 2.3, 1.6, 0.7, 0.2  # m, the last of cells
inner, end = length - arm_width, width + arm_length

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
geometry = gmsh.model.geo
corners = [(0, 0), (length, 0), (length, end - sponge), (inner, end - sponge), (inner, width), (0, width)]
points = [geometry.addPoint(x, y, 0, size) for x, y in corners]
lines = [geometry.addLine(start, stop) for start, stop in zip(points, points[1:] + points[:1], strict=True)]
water = geometry.addPlaneSurface([geometry.addCurveLoop(lines)])

last = [geometry.addPoint(x, end, 0, size) for x in (length, inner)]
sides = [geometry.addLine(points[2], last[0]), geometry.addLine(*last), geometry.addLine(last[1], points[3])]
beach = geometry.addPlaneSurface([geometry.addCurveLoop([*sides, -lines[2]])])
geometry.synchronize()

gmsh.model.addPhysicalGroup(1, lines[-1:], name="paddle")
gmsh.model.addPhysicalGroup(1, [line for line in lines[:-1] if line != lines[2]] + sides, name="wall")
gmsh.model.addPhysicalGroup(2, [water], name="water")
gmsh.model.addPhysicalGroup(2, [beach], name="sponge")
gmsh.model.mesh.generate(2)
gmsh.write(sys.argv[1])
gmsh.finalize()
