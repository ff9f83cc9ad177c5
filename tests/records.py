"""Records of gauges and snapshots of surfaces, as run directories and data sets give them."""

import numpy as np
from mpi4py import MPI
from xarray import Dataset, concat

from wavetank.output.columns import gauge_array
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records


def with_numerics(case, **numerics):
    """Return a case with changed numerics."""
    changes = ({"cell_size": None} if "cells" in numerics else {}) | numerics
    return case.model_copy(update={"numerics": case.numerics.model_copy(update=changes)})


def gauge_rows(case, **numerics):
    """Return times [s] and elevations [m] at the gauges of a run with changed numerics, shape (N, 1 + gauges)."""
    changed, record = with_numerics(case, **numerics), Memory()
    run, waves = build_run(changed, MPI.COMM_SELF)
    run.diagnostics += build_observers(changed, waves, Records(record, Memory(), None), sinks=run.sinks)
    run.execute()
    return record.array()


def gauge(name, x, t, eta, source="computed", y=0.0):
    """Return the record of one gauge at (x, y) [m]: elevation [m] over time [s]."""
    return gauge_array([name], [x], [y], t, [eta], source=source)[0]


def gauges(*records, **attributes):
    """Return records of gauges over gauge and time."""
    if not records:
        return gauge_array([], [], [], [0.0], np.zeros((0, 1)))
    each = [gauge_array([one.gauge.item()], [one.x], [one.y], one.time, [one]) for one in records]
    result = concat(each, "gauge", coords="minimal", compat="override", join="outer")
    return result.assign_attrs(records[0].attrs | attributes)


def surface(t, x, eta, psi=None):
    """Return snapshots of a surface: fields of shape (times, points) at x [m] of that shape."""
    fields = {"elevation": eta, "surface_potential": 0 * eta if psi is None else psi}
    coordinates = {"time": np.asarray(t, dtype=float), "x": (("time", "point"), x)}
    return Dataset({name: (("time", "point"), values) for name, values in fields.items()}, coordinates)
