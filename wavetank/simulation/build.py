"""Construction of a run from a case: scheme, time step, start, filters and observers."""

from math import inf
from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError, Problem, about
from wavetank.base.errors import InputError
from wavetank.base.mpi import raise_on_all_ranks
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS, Damping, damped
from wavetank.integrators.contract import Integrator
from wavetank.integrators.stages import ITERATES
from wavetank.integrators.wrappers import ControlledPaddles
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.simulation.construction import AnyWaves, build_filters, build_footprint, build_sponge, fill
from wavetank.simulation.feedback import build_controllers, build_paddle_work
from wavetank.simulation.initial import StoredSurface, initial_surface
from wavetank.simulation.own import check_states, own_scheme
from wavetank.simulation.run import Run, restore_surviving
from wavetank.tank.breakdown import FARTHEST, ShortWaves
from wavetank.tank.linear_waves import LinearWaves

MANY_UNKNOWNS = 100_000  # number of unknowns of a basin above which several ranks are faster
ANSWERED = 1.25  # omega_max dt above which absorbing flaps have been unstable


def stability_limit(case: Case, integrator: Integrator[Any]) -> float:
    """Return the largest dt omega_max of an integrator, with absorbing paddles at most ``ANSWERED``."""
    return min(float(integrator.stability_limit), ANSWERED if case.absorbing else inf)


def initial_state(case: Case, waves: AnyWaves) -> tuple[Vector, Vector]:
    """Return (Q, psi) of the initial surface of a case; collective. Raises ``InputError`` if it lies below the bed."""
    comm = waves.plane.comm
    with about("initial"):
        eta, psi = initial_surface(case, waves)
        state = waves.state(eta, psi)
        lowest = comm.allreduce(float(np.min(waves.bed.still + eta, initial=np.inf)), op=MPI.MIN)
        if not lowest > 0.0:
            raise InputError(f"its surface is up to {-lowest:.3g} m below the bed; must be above the bed everywhere.")
        return state


def build_clock(
    case: Case,
    largest_frequency: float,
    integrator: Integrator[Any],
    *,
    moving: float | None = None,
    begin: float = 0.0,
) -> Clock:
    """Return the clock of a case, for the largest frequency of its mesh [rad/s].

    The default step divides the duration. It is at most 0.6 of the stability limit on still water, ``FARTHEST`` of the
    limit at the largest displacement of a paddle, and 1.4 times the limit on the ``moving`` surface of the start, if
    that has a larger frequency. Its relative frequency error is below 1e-4 for waves of a quarter of the largest
    frequency. Free waves are without noise at twice the limit; a steep wave that runs up a wall is at 1.4, not at 1.75
    (docs/extremes.md). A given step is unchanged: the last step ends beyond the duration, or before it if a
    recorded motion ends there. The duration is counted from ``begin`` [s].
    Raises ``InputError`` for an unstable step.
    """
    duration = case.run.duration - begin
    limit = integrator.stability_limit / largest_frequency
    if case.numerics.dt is None:
        coefficient, power = integrator.frequency_error
        accurate = 4.0 / largest_frequency * (1e-4 / coefficient) ** (1.0 / power)
        steep = 1.4 * min(integrator.stability_limit, ITERATES) / (moving or largest_frequency)
        return Clock.dividing(duration, min(0.6 * limit, FARTHEST * limit / case.frequency_shift, accurate, steep))
    if case.numerics.dt > limit:
        allowed = (
            f"must be below {limit:.4g} s, the stability limit of {integrator.name} on this mesh (largest frequency "
            f"{largest_frequency:.4g} rad/s)"
        )
        raise CaseError([Problem(("numerics", "dt"), case.numerics.dt, allowed)])
    with about("numerics", "dt"):
        return Clock.covering(duration, case.numerics.dt, until=case.motions_end - begin)


def build_run(
    case: Case, comm: MPI.Comm, integrator: Integrator[Any] | None = None, *, beginning: StoredSurface | None = None
) -> tuple[Run, AnyWaves]:
    """Return the run of a case, without diagnostics, and its waves; collective.

    Its breaking filters may stop it. Its integrator is the case's or the given one. It starts with the initial state of
    the case or at ``beginning``. Raises ``InputError`` for numerics that cannot be used or that are not planned yet
    (``wavetank.planning.plan``).
    """
    if case.numerics.accuracy is not None:
        raise InputError(f"numerics.accuracy = {case.numerics.accuracy:g}: must be planned before the run.")
    with about("tank", "layout"):
        footprint = build_footprint(case, comm)
    waves = fill(case, footprint)
    integrator = INTEGRATORS[case.numerics.integrator]() if integrator is None else own_scheme(integrator)
    if case.sponge is not None:
        with about("sponge"):
            damping = Damping(build_sponge(case, case.sponge, footprint, waves))
        integrator = damped(integrator, damping)
        waves.damp(damping.gamma)
    controllers = build_controllers(case, waves)
    if controllers:
        integrator = ControlledPaddles(integrator, controllers)
        if beginning is not None:
            paddles = {f"paddle {n}": paddle for n, paddle in enumerate(controllers)}
            restore_surviving(paddles, beginning.parts)  # positions of the paddles
    largest = waves.largest_frequency  # with the wall at rest
    t, step = (beginning.t, beginning.step) if beginning else (0.0, 0)
    waves.set_time(t)
    start = waves.state(*beginning.on(waves), t) if beginning else initial_state(case, waves)
    moving = _moving(waves, start, t)
    clock = raise_on_all_ranks(
        comm, lambda: build_clock(case, largest, integrator, moving=moving, begin=t).after(t, step)
    )
    if controllers and clock.dt * largest > ANSWERED:
        allowed = f"must be at most {ANSWERED / largest:.4g} s: an absorbing paddle measures the water once per step"
        raise CaseError([Problem(("numerics", "dt"), case.numerics.dt, allowed)])
    filters = build_filters(case, waves, clock.dt)
    run = Run(waves, integrator, [], start=start, clock=clock, filters=filters)
    below = case.probes or case.loads or case.windows or case.output.velocity_every is not None
    if case.absorbing and (below or isinstance(waves, LinearWaves)):
        run.longest_block = 1  # diagnostics evaluate motions; a feedback motion is that of the last step
    run.paddle_work = build_paddle_work(case, waves)
    check_states(run)
    return run, waves


def _moving(waves: AnyWaves, start: tuple[Vector, Vector], t: float) -> float:
    """Return the largest frequency on the moving surface of the start at t [s], in rad/s; collective."""
    if isinstance(waves, LinearWaves):
        return waves.largest_frequency
    waves.surface.update(*start, t)
    return ShortWaves(waves).largest_frequency(waves.surface)


def summary(case: Case, run: Run, waves: AnyWaves) -> str:
    """Return a description of a run in one line."""
    limit = run.integrator.stability_limit
    bound = f" of {limit:g}" if limit < inf else ", stable at any"
    steps = run.clock.steps - run.clock.first
    water = "linear water, " if isinstance(waves, LinearWaves) else ""
    return (
        f"{case.title or 'untitled'}: {water}{waves.plane.cells} cells of order {waves.plane.order}, "
        f"n = {waves.vertical.n}, "
        f"{_unknowns(waves)} unknowns; {steps} steps of {run.clock.dt:.4g} s ({run.integrator.name}, "
        f"dt omega_max = {run.clock.dt * waves.largest_frequency:.2f}{bound})"
    )


def end_message(case: Case, clock: Clock) -> str:
    """Return a sentence if the last step ends before or beyond the duration; otherwise empty."""
    if abs(clock.end - case.run.duration) <= ROUNDING * case.run.duration:
        return ""
    step = f"a whole step of {clock.dt:.4g} s"
    beyond = "" if clock.end > case.run.duration else ": one more step would end beyond the recorded motion"
    return f"the run ends at {clock.end:.6g} s, with {step}, not at {case.run.duration:.6g} s{beyond}"


def ranks_message(waves: AnyWaves) -> str:
    """Return a sentence if one rank is as fast as the ranks of the run, or faster; otherwise empty."""
    ranks, unknowns = waves.plane.comm.size, _unknowns(waves)
    if ranks > 1 and waves.plane.mesh.topology.dim == 1:
        return f"a slice or ring is fastest on one rank, with compiled solves: {ranks} take many times as long"
    if ranks == 1 or unknowns >= MANY_UNKNOWNS:
        return ""
    return f"{unknowns} unknowns are few for {ranks} ranks: below about {MANY_UNKNOWNS}, one rank may be as fast"


def _unknowns(waves: AnyWaves) -> int:
    return waves.plane.size * (waves.vertical.n + 2)
