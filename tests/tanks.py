"""Tanks that several tests step by a scheme, or run in memory."""

import numpy as np
from dolfinx import mesh
from mpi4py import MPI

from wavetank.base.toml import toml
from wavetank.case import Case
from wavetank.output.columns import energy_columns
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records
from wavetank.tank.crests import SteepCrest
from wavetank.tank.walls import Side

GRAVITY = 9.81
ENERGIES = ("total", "balance", "paddle_work", "dissipated")
TOTAL, BALANCE, WORK, TAKEN = (energy_columns(1).index(f"{name} [m^4/s^2]") for name in ENERGIES)
MASS = energy_columns(1).index("mass [m^2]")
CREST = SteepCrest(x=2.0, height=1.0, velocity=1.8, current=0.0, speed=2.0, front=0.5, coherence=1.0, outrun=0.0)


def advanced(system, scheme, start, *, steps, dt):
    """Return the state of a scheme after some steps from (q, p)."""
    state = scheme.start(*start)
    for step in range(steps):
        state = scheme.step(system, state, step * dt, dt)
    return state


def executed(case, comm=MPI.COMM_SELF):
    """Return a run at its end, its waves, and the rows of its gauges and of its energy budget; collective."""
    case, gauges, energy = Case.model_validate(case), Memory(), Memory()
    run, waves = build_run(case, comm)
    run.diagnostics += build_observers(case, waves, Records(gauges, energy, None), sinks=run.sinks)
    run.execute()
    return run, waves, gauges.array(), energy.array()


def surface(run, waves):
    """Return elevation [m] and surface potential [m²/s] at the end of a run in the order of x, and x [m]."""
    order = np.argsort(waves.plane.x)
    eta_psi = np.array([waves.elevation(run.state.q, run.state.p, run.t), run.state.p])
    return eta_psi[:, order], waves.plane.x[order]


def case_of(wall=None, far_wall=None, *, length=4.0, duration=0.4, dt=0.02, cells=4, n=4, tolerance=1e-9, **more):
    """Return the case of a tank 1 m deep; other keys of the numerics are in ``more["numerics"]``."""
    numerics = {"cells": cells, "order": 3, "vertical_order": n, "dt": dt, "tolerance": tolerance}
    parts = {"tank": {"length": length, "depth": 1.0}, "run": {"duration": duration}}
    parts |= {key: one for key, one in (("wall", wall), ("far_wall", far_wall)) if one}
    return Case.model_validate({**parts, **more, "numerics": numerics | more.get("numerics", {})})


def written(path, case):
    """Return the path of a case that is written to it."""
    path.write_text(toml(case.model_dump(mode="json", exclude_unset=True)))
    return path


def rectangle(length, width, cells, *, kind="quadrilaterals", angle=0.0, comm=MPI.COMM_WORLD):
    """Return a mesh and its paddle's side, the one at x = 0 before the mesh is turned by an angle about (0, 0)."""
    kinds = {"quadrilaterals": mesh.CellType.quadrilateral, "triangles": mesh.CellType.triangle}
    footprint = mesh.create_rectangle(
        comm, [[0, 0], [length, width]], cells, kinds[kind], ghost_mode=mesh.GhostMode.shared_facet
    )
    facets = mesh.locate_entities_boundary(footprint, 1, lambda x: np.isclose(x[0], 0.0))
    tags = mesh.meshtags(footprint, 1, facets, np.ones(facets.size, dtype=np.int32))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    footprint.geometry.x[:, :2] = footprint.geometry.x[:, :2] @ turn.T
    return footprint, Side(tags, np.zeros(2), turn[:, 0])
