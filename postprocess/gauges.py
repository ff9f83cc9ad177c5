"""Draw computed gauges against measured ones.

The measurements are a CSV file with a column t [s] and a column for each gauge [m], under the gauges' names.

./env python postprocess/gauges.py runs/focusing measured.csv gauges.png
"""

import sys

import numpy as np
from matplotlib.figure import Figure

import wavetank as wt

run_directory, table, picture = sys.argv[1:]
run = wt.open_run(run_directory)
measured = np.genfromtxt(table, delimiter=",", names=True, deletechars="")
time, *columns = measured.dtype.names
names = [name for name in run.gauges.gauge.values if name in columns]

figure = Figure(figsize=(9, 1 + 2 * len(names)), layout="constrained")
for axes, name in zip(figure.subplots(len(names), sharex=True, squeeze=False)[:, 0], names, strict=True):
    computed = run.gauges.sel(gauge=name, time=slice(*measured[time][[0, -1]]))
    reference = np.interp(computed.time, measured[time], measured[name])
    misfit = float(np.sqrt(((computed - reference) ** 2).mean() / (reference**2).mean()))
    axes.plot(measured[time], 100 * measured[name], color="black", label="measured")
    axes.plot(computed.time, 100 * computed, color="tab:red", label="computed")
    axes.set(ylabel="elevation [cm]", title=f"gauge {name}, x = {float(computed.x):g} m, nrms {misfit:.3f}")
axes.set(xlabel="time [s]", xlim=(float(run.gauges.time[0]), float(run.gauges.time[-1])))
axes.legend()
figure.savefig(picture, dpi=150)
