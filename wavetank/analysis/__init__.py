"""What records of gauges say of the waves: one kind of analysis a file, each of functions on xarray.

All take the elevation [m] over ``gauge`` and ``time`` [s], as ``RunDirectory.gauges`` gives it and
``records.elevation`` makes it of any records; gauges have their places x and y [m]. ``kinds.py`` puts them together for
``wavetank analyse``, ``figures.py`` draws what they return.
"""
