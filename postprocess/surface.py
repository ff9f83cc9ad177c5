"""Draw the surface elevation of a slice over place and time.

./env python postprocess/surface.py runs/focusing surface.png
"""

import sys

from matplotlib.figure import Figure

import wavetank as wt

run_directory, picture = sys.argv[1:]
run = wt.open_run(run_directory)
eta = run.surface.elevation  # [m], over time and x; over time and point where the mesh moves

figure = Figure(figsize=(9, 5), layout="constrained")
axes = figure.subplots()
x, t = (eta.x.broadcast_like(eta), eta.time.broadcast_like(eta))
colours = axes.pcolormesh(x, t, 100 * eta, cmap="RdBu_r", shading="gouraud")
figure.colorbar(colours, label="elevation [cm]")
axes.set(xlabel="x [m]", ylabel="time [s]", title=run.title)
figure.savefig(picture, dpi=150)
