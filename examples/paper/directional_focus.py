"""A directional focus by a segmented paddle, of small and of finite amplitude, compared with linear theory.

Half the basin of cases/directional-focus.toml, with the focus on its plane of symmetry. The theory is that of the
paddle motion (``waves/focusing.py``). It includes the side walls, but neither the ramp nor the far end.
"""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.tri import Triangulation
from mpi4py import MPI
from numpy.typing import NDArray

from examples.paper.report import Report
from examples.paper.watched import Surfaces
from wavetank.base.errors import InputError
from wavetank.case import Case, ReflectedFocusMotion, SegmentedPistonWall
from wavetank.case.reading import read_case
from wavetank.simulation.build import build_run

CASE = Path(__file__).resolve().parents[2] / "cases" / "directional-focus.toml"
HALF = ("tank.layout.origin=[0.0, 0.0]", "tank.layout.width=3.0", "gauges=[]", "gauge_lines=[]", "run.duration=11.0")
SMALL, LARGE = 0.002, 0.05  # m: k_p A = 0.006 and 0.14
SEEN = 0.6  # m: of the crest, its half width and more

Array = NDArray[np.float64]


class Focus:
    """A case whose paddle moves for a ``reflected-focus``, computed on this rank alone; elevations are over A.

    Attributes
    ----------
    motion
        Motion model of the case.
    x, y
        Of the degrees of freedom [m], shape (N,).
    t
        Of all steps [s], shape (T,).
    eta
        Elevation over A, shape (T, N).
    """

    def __init__(self, case: Case):
        run, waves = build_run(case, MPI.COMM_SELF)
        surfaces = Surfaces()
        run.diagnostics.append(surfaces)
        run.execute()
        self._case, self.motion = case, _motion(case)
        self.x, self.y = waves.plane.places.T
        self.t, self.eta = np.array(surfaces.t), np.array(surfaces.eta) / self.motion.linear_crest

    @cached_property
    def distance(self) -> Array:
        """From the focus [m], shape (N,)."""
        return np.asarray(np.hypot(self.x - self.motion.focus_x, self.y - self.motion.focus_y))

    @cached_property
    def history(self) -> Array:
        """Elevation over A at the focus, shape (T,)."""
        return np.asarray(self.eta[:, self.distance.argmin()])

    @cached_property
    def in_focus(self) -> Array:
        """Elevation over A at the focus time, shape (N,): by the cubic through the four steps about it."""
        near = np.argsort(np.abs(self.t - self.motion.focus_time))[:4]
        powers = np.vander(self.t[near] - self.motion.focus_time, increasing=True)
        return np.asarray(np.linalg.solve(powers, self.eta[near])[0])

    def linear(self, t: float) -> Array:
        """Return the theory's elevation over A at a time [s], shape (N,)."""
        waves = self.motion.target(self._case.tank)
        return np.asarray(waves.elevation(self.x, t, y=self.y) / self.motion.linear_crest)

    def misfit(self, *, beyond: float) -> float:
        """Return the root mean square difference from theory in focus, over that of theory.

        From one depth before the paddle, whose near field theory leaves out, to ``beyond`` [m] the focus.
        """
        exact = self.linear(self.motion.focus_time)
        seen = (self.x > self._case.tank.depth) & (self.x < self.motion.focus_x + beyond)
        difference = (self.in_focus - exact)[seen]
        return float(np.sqrt(np.mean(difference**2) / np.mean(exact[seen] ** 2)))


def _motion(case: Case) -> ReflectedFocusMotion:
    wall = case.wall
    if isinstance(wall, SegmentedPistonWall) and isinstance(wall.motion, ReflectedFocusMotion):
        return wall.motion
    raise InputError(f"wall.type = {wall.type}: must be a segmented-piston with a motion of type reflected-focus.")


class FocusRow(NamedTuple):
    """Crest at the focus over A, and misfit of the elevation up to the sponge."""

    amplitude_m: float
    crest: float
    crest_time_s: float
    linear_crest: float
    trough_before: float
    trough_after: float
    highest_elsewhere: float
    misfit: float


def row(focus: Focus) -> FocusRow:
    """Return a row of the table."""
    top = int(focus.history.argmax())
    exact = focus.linear(focus.motion.focus_time)
    return FocusRow(
        focus.motion.linear_crest,
        float(focus.history[top]),
        float(focus.t[top]),
        float(exact[focus.distance.argmin()]),
        float(focus.history[:top].min()),
        float(focus.history[top:].min()),
        float(focus.eta[:, focus.distance > SEEN].max()),
        focus.misfit(beyond=1.5),
    )


def _draw_layout(axes: Axes, focus: Focus, eta: Array) -> Any:
    """Draw an elevation over A in plan, mirrored at the plane of symmetry."""
    x, y, both = np.tile(focus.x, 2), np.concatenate([focus.y, -focus.y]), np.tile(eta, 2)
    levels = np.linspace(-1.0, 1.1, 22)
    drawn = axes.tricontourf(
        Triangulation(x, y), both, levels=levels, cmap="RdBu_r", extend="both", vmin=-1.1, vmax=1.1
    )
    axes.set(aspect="equal", xlabel="x [m]", xlim=(0, 5.5))
    axes.grid(visible=False)
    return drawn


def _draw_across(axes: Axes, focuses: Sequence[Focus]) -> None:
    """Draw the elevation in focus along the crest."""
    for focus, mark in zip(focuses, ("o", "s"), strict=True):
        on = np.flatnonzero(np.isclose(focus.x, focus.motion.focus_x))
        on = on[np.argsort(focus.y[on])]
        y = np.concatenate([-focus.y[on][::-1], focus.y[on]])
        if focus is focuses[0]:
            exact = focus.linear(focus.motion.focus_time)[on]
            axes.plot(y, np.concatenate([exact[::-1], exact]), color="#666666", label="linear theory")
        eta = focus.in_focus[on]
        label = f"A = {1000 * focus.motion.linear_crest:g} mm"
        axes.plot(y, np.concatenate([eta[::-1], eta]), mark, mfc="none", ms=4, label=label)
    axes.set(xlabel="y [m]", ylabel="η / A [-]", title="Across, through the focus")
    axes.legend(fontsize=8)


def _draw_history(axes: Axes, focuses: Sequence[Focus]) -> None:
    """Draw the elevation at the focus against time."""
    near = focuses[0].distance.argmin()
    t = np.linspace(8.0, 11.0, 121)
    axes.plot(t, [focuses[0].linear(float(one))[near] for one in t], color="#666666")
    for focus, mark in zip(focuses, ("o", "s"), strict=True):
        late = focus.t > 8.0
        axes.plot(focus.t[late], focus.history[late], mark, mfc="none", ms=3)
    axes.set(xlabel="t [s]", ylabel="η / A [-]", title="At the focus")


def write(report: Report) -> None:
    """Write directional-focus.csv and .png."""
    focuses = [Focus(read_case(CASE, [*HALF, f"wall.motion.linear_crest={one}"])) for one in (SMALL, LARGE)]
    report.table("directional-focus", FocusRow._fields, [row(focus) for focus in focuses])
    with report.figure("directional-focus", 13, 7.5) as figure:
        (theory, steep), (across, history) = figure.subplots(2, 2, height_ratios=(3, 2))
        exact = focuses[0].linear(focuses[0].motion.focus_time)
        _draw_layout(theory, focuses[0], exact)
        drawn = _draw_layout(steep, focuses[1], focuses[1].in_focus)
        theory.set(title="Linear theory at the focus time", ylabel="y [m]")
        steep.set(title=f"Computed, A = {1000 * LARGE:g} mm")
        figure.colorbar(drawn, ax=[theory, steep], label="η / A [-]", shrink=0.8)
        _draw_across(across, focuses)
        _draw_history(history, focuses)
