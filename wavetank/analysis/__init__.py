"""Wave statistics of gauge records and of runs, on xarray.

All take the elevation [m] over ``gauge`` and ``time`` [s], as ``RunDirectory.gauges`` gives it and
``signals.elevation`` makes it of any records; gauges have their places x and y [m]. ``results`` combines them for
``wavetank analyse``; ``plots/analysis_figures.py`` draws its results.
"""
