"""Film the surface of a slice along the tank, as a GIF.

./env python postprocess/film.py runs/focusing film.gif
"""

import sys

from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

import wavetank as wt

run_directory, film = sys.argv[1:]
run = wt.open_run(run_directory)
eta = 100 * run.surface.elevation  # [cm]
x = eta.x.broadcast_like(eta)

figure = Figure(figsize=(9, 3), layout="constrained")
axes = figure.subplots()
(line,) = axes.plot(x[0], eta[0])
axes.set(xlabel="x [m]", ylabel="elevation [cm]", ylim=(1.1 * float(eta.min()), 1.1 * float(eta.max())))


def draw(n):
    """Draw snapshot n."""
    line.set_data(x[n], eta[n])
    axes.set_title(f"t = {float(eta.time[n]):.2f} s")


FuncAnimation(figure, draw, frames=range(eta.time.size)).save(film, PillowWriter(fps=20))
