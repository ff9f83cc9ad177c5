"""Draw the variance density spectra of a run's gauges, with Hm0 and Tp in the legend.

./env python postprocess/spectrum.py runs/irregular spectrum.png
"""

import sys

from matplotlib.figure import Figure

import wavetank as wt
from wavetank.analysis.signals import sea_state, spectrum

run_directory, picture = sys.argv[1:]
run = wt.open_run(run_directory)
density = spectrum(run.gauges)  # [m^2/Hz], over gauge and frequency
sea = sea_state(density)

figure = Figure(figsize=(8, 5), layout="constrained")
axes = figure.subplots()
for name in density.gauge.values:
    hm0, tp = float(sea.hm0.sel(gauge=name)), float(sea.tp.sel(gauge=name))
    label = f"gauge {name}: Hm0 = {100 * hm0:.3g} cm, Tp = {tp:.3g} s"
    axes.plot(density.frequency, 1e4 * density.sel(gauge=name), label=label)
axes.set(xlabel="frequency [Hz]", ylabel="variance density [cm²/Hz]", title=run.title)
axes.set_xlim(0, 4 / float(sea.tp.min()))
axes.legend()
figure.savefig(picture, dpi=150)
