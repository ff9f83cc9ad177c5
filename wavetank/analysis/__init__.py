"""Wave statistics of gauge records and of runs, on xarray.

The functions use the elevation [m] over ``gauge`` and ``time`` [s], as returned by ``RunDirectory.gauges`` and
``signals.common_clock``; gauges have positions x and y [m]. ``results`` combines them for ``wavetank analyse``;
``plots/analysis_figures.py`` draws its results.
"""
