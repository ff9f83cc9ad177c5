"""Records of gauges and snapshots of surfaces, as run directories and data sets give them; tables that are written."""

import csv

import numpy as np
from conftest import commanded
from mpi4py import MPI
from xarray import Dataset, concat

from wavetank.output.columns import gauge_array
from wavetank.output.directory import RunDirectory
from wavetank.output.writer import RunWriter
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
    """Return snapshots of a surface: fields of shape (times, points) at x [m] of that shape, or of each time."""
    fields = {"elevation": eta, "surface_potential": 0 * eta if psi is None else psi}
    coordinates = {"time": np.asarray(t, dtype=float), "x": (("time", "point"), np.broadcast_to(x, np.shape(eta)))}
    return Dataset({name: (("time", "point"), values) for name, values in fields.items()}, coordinates)


def write_run(path, scene=None, *, gauges=None, surface=None, tables=(), status="finished", **results):
    """Write a run directory of a scene (a case or a dictionary) with gauges, snapshots and tables; return it.

    ``tables``: columns and rows by the names of the files.
    """
    content = scene if scene is None or isinstance(scene, dict) else scene.model_dump(mode="json")
    with RunWriter(path, {"case": content or {}}) as writer:
        if gauges is not None:
            table = writer.gauges([(one.gauge.item(), one.x.item(), one.y.item()) for one in gauges])
            table.extend(np.column_stack([gauges.time, *gauges]))
        if surface is not None:
            fields = surface.x, surface.elevation, surface.surface_potential
            writer.surface().extend(np.hstack([surface.time.values[:, None], *fields]))
        for file, (columns, rows) in dict(tables).items():
            writer.table(file, columns).extend(rows)
        writer.finish(status, results)
    return RunDirectory(path)


def csv_rows(path):
    """Return the rows of a table as dictionaries of texts."""
    with path.open() as file:
        return list(csv.DictReader(file))


def refusal(*words):
    """Return the one sentence with which a command refuses its input."""
    done = commanded(*words)
    assert done.returncode == 2 and done.stderr.startswith("wavetank: ") and done.stderr.count("\n") == 1, done
    return done.stderr
