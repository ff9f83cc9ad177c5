"""The sponge: its exact factor in any scheme, the energy it takes, and what it reflects.

Oracles: the damped oscillator's exact solution, conservation, linear waves in the frequency domain, the same on other
numbers of ranks and in another footprint.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from blocks import block_of
from conftest import fitted_slope
from dolfinx import mesh
from mpi4py import MPI
from tanks import BALANCE, TAKEN, TOTAL, advanced, case_of, rectangle

from examples.paper.oscillators import Harmonic
from examples.paper.sponge import Beach, Operators, in_time, paddle
from wavetank.base.errors import InputError
from wavetank.case.tank import EndSponge, GroupSponge, SliceTank, paddle_period
from wavetank.fem.plane import Plane
from wavetank.integrators import INTEGRATORS, Damped, Damping, Simpson4, StormerVerlet, ThirdOrder, damped
from wavetank.integrators.contract import like, rows
from wavetank.integrators.wrappers import Filtered
from wavetank.motion import AT_REST, ramped, sinusoid
from wavetank.simulation.construction import build_sponge
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory
from wavetank.tank.dissipation import EdgePenalty, checked, distance_from_edge, profile
from wavetank.tank.footprint import Slice
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.walls import LinearPaddle, Paddle, Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.airy import group_velocity
from wavetank.waves.damped_waves import reflection

SCHEMES = {name: scheme() for name, scheme in INTEGRATORS.items()}
each_scheme = pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
usual_scheme = pytest.mark.parametrize("scheme", [ThirdOrder(), Simpson4()], ids=["third-order", "simpson-4"])


def sponged(scheme, gamma):
    """Return a scheme with a sponge."""
    return damped(scheme, Damping(gamma))


def watched(waves, scheme, start, *, gamma, steps, dt, sinks=()):
    """Return the state after some steps, and the budget and its rows, of all of them."""
    waves.damp(gamma)
    record = Memory()
    budget = EnergyBudget(waves, record=record, sinks=sinks)
    filtered = Filtered(sponged(scheme, gamma), sinks)
    state = filtered.start(*start)
    budget.record(block_of(waves, (0, 0.0, state), sinks=sinks))
    for step in range(steps):
        state = filtered.step(waves, state, step * dt, dt)
        budget.record(block_of(waves, (step + 1, (step + 1) * dt, state), sinks=sinks))
    return state, budget, record.array()


SLOPE = {"least": 0.1, "share": 0.5}


def linear(*, length=1.0, cells=8, depth=0.5):
    footprint = Slice(length, cells, comm=MPI.COMM_SELF)
    plane = Plane(footprint.mesh, 3, footprint.chart)
    return LinearWaves(plane, depth=depth, wall=Wall(), vertical_order=4)


# ---------------------------------------------------------------- the factor
@each_scheme
def test_the_damped_oscillator_is_met_to_the_order_of_the_scheme(scheme):
    """Of q'' + gamma q' + q = 0: q = e^(-gamma t/2) (cos wt + gamma/(2w) sin wt)."""
    gamma, t = 0.4, 12.0
    omega = np.sqrt(1 - gamma**2 / 4)
    decay = np.exp(-gamma * t / 2)
    q = decay * (np.cos(omega * t) + gamma / (2 * omega) * np.sin(omega * t))
    p = -decay / omega * np.sin(omega * t)
    counts, errors = (60, 120, 240, 480), []
    for count in counts:
        around, start = sponged(scheme, np.array([gamma])), (np.array([1.0]), np.array([0.0]))
        state = advanced(Harmonic(), around, start, steps=count, dt=t / count)
        errors.append(np.hypot(state.q[0] - q, state.p[0] - p))
    assert -fitted_slope(counts, errors) == pytest.approx(scheme.order, abs=0.1)


@each_scheme
def test_without_damping_nothing_changes(scheme):
    waves = linear()
    start = waves.state(0.1 * np.cos(np.pi * waves.plane.x), 0.1 * np.cos(2 * np.pi * waves.plane.x))
    around = sponged(scheme, np.zeros(waves.plane.owned))
    bare, wrapped = (advanced(linear(), one, start, steps=20, dt=0.01) for one in (scheme, around))
    assert np.array_equal(bare.q, wrapped.q) and np.array_equal(bare.p, wrapped.p)
    known = ("name", "order", "stability_limit", "frequency_error", "nodes")
    assert all(getattr(around, name) == getattr(scheme, name) for name in known)


def test_step_with_negative_dt_undoes_the_damping():
    """Of the damped oscillator, by a reversible scheme: (38) has no damping left, forth or back."""
    scheme, start = sponged(StormerVerlet(), np.array([0.4])), (np.array([0.7]), np.array([0.2]))
    there = scheme.step(Harmonic(), scheme.start(*start), 0.0, 0.1)
    back = scheme.step(Harmonic(), there, 0.1, -0.1)
    assert back.p == pytest.approx(start[1], rel=1e-12) and back.q == pytest.approx(start[0], rel=1e-12)


@pytest.mark.parametrize("strength", [2.0, 50.0])
def test_damping_in_the_formulae_of_a_scheme_is_that_around_it(strength):
    """Oracle: the growing Hamiltonian of (38), given to the scheme as it is; its jumps are left undamped."""
    waves = linear()
    start = waves.state(0.1 * np.cos(np.pi * waves.plane.x), 0.1 * np.cos(2 * np.pi * waves.plane.x))
    damping = Damping(profile(waves.plane.x - 0.4, width=0.6, strength=strength))
    within, around = damped(Simpson4(0.0), damping), Damped(Simpson4(0.0), damping)
    one, other = (advanced(waves, scheme, start, steps=20, dt=0.02) for scheme in (within, around))
    assert type(within) is not Damped
    assert np.abs(one.values[:2] - other.values[:2]).max() < 1e-13


def test_subclass_of_a_damped_scheme_uses_its_step():
    class Late(Simpson4):
        def step(self, system, state, t, dt):
            return super().step(system, state, t, 0.5 * dt)

    start, damping = (np.array([1.0]), np.array([0.0])), Damping(np.array([0.0]))
    slow, bare = (advanced(Harmonic(), one, start, steps=1, dt=0.1) for one in (damped(Late(), damping), Late()))
    assert slow.q == bare.q and slow.p == bare.p


@each_scheme
@pytest.mark.parametrize("strength", [1.0, 100.0])
def test_a_step_below_the_schemes_limit_is_stable_with_a_sponge_of_any_strength(scheme, strength):
    """The spectral radius of a step of linear waves, as a dense matrix, is one to round-off; gamma dt is up to 10."""
    waves = linear(length=2.0, cells=4, depth=1.0)
    size, dt = waves.plane.owned, 0.99 * min(scheme.stability_limit, 2.0) / waves.largest_frequency
    sponge = sponged(scheme, profile(waves.plane.x - 1.0, width=1.0, strength=strength))
    rest = sponge.start(*waves.state(*np.zeros((2, size))))

    def stepped(change):
        state = like(rest, rows(rest) + change.reshape(-1, size))
        return rows(sponge.step(waves, state, 0.0, dt)).ravel()

    still = stepped(np.zeros(rows(rest).size))
    matrix = np.column_stack([stepped(unit) - still for unit in np.eye(still.size)])
    assert np.abs(np.linalg.eigvals(matrix)).max() == pytest.approx(1.0, abs=1e-9)


@usual_scheme
def test_sponge_costs_no_solve(scheme):
    """Counted of linear waves, whose states are evaluated at every step."""
    waves, found = linear(), []
    start = waves.state(np.zeros(waves.plane.owned), np.cos(np.pi * waves.plane.x))
    for one in (scheme, sponged(scheme, np.full(waves.plane.owned, 0.5))):
        state, before = one.start(*start), waves.potential.counters.solves
        for step in range(10):
            state = one.step(waves, state, step * 0.01, 0.01).evaluated(waves, (step + 1) * 0.01)
        found.append((waves.potential.counters.solves - before) / 10)
    assert found[1] == found[0]


# ---------------------------------------------------------------- the energy budget
def test_the_budget_of_a_piston_and_a_sponge_closes_to_the_error_of_scheme_and_work(make_tank):
    """Of the fourth order, as scheme and integral."""
    waves = make_tank(length=3.0, cells=6, n=4, motion=ramped(sinusoid(0.05, 1.3), 1.0), reach=1.0)
    gamma = profile(waves.plane.x - 1.0, width=2.0, strength=3.0)
    start = waves.state(0.05 * np.cos(np.pi * waves.plane.x / 3), 0 * waves.plane.x)
    counts, balances = (40, 80), []
    for count in counts:
        _, _, rows = watched(waves, Simpson4(), start, gamma=gamma, steps=count, dt=2.0 / count)
        balances.append(np.abs(rows[:, BALANCE]).max())
        assert rows[-1, TAKEN] > 0.2 * rows[-1, TOTAL]
    assert balances[-1] < 1e-3 * rows[-1, TAKEN]
    assert -fitted_slope(counts, balances) > 3.7


@pytest.mark.parametrize(("strength", "sound"), [(3.0, True), (300.0, False)])
def test_sponge_that_supplies_energy_raises_a_warning(make_tank, strength, sound):
    """One that begins like a wall, where the water moves: its potential jumps, and that is energy."""
    waves = make_tank(length=4.0, cells=16, n=4)
    inside = waves.plane.x - 2.0
    gamma = profile(inside, width=2.0, strength=strength) if sound else np.where(inside > 0.05, strength, 0.0)
    start = waves.state(0 * waves.plane.x, 0.2 * np.cos(np.pi * waves.plane.x / 2) + 0.5)
    _, budget, _ = watched(waves, ThirdOrder(), start, gamma=gamma, steps=5, dt=0.02)
    warnings = [str(one) for one in budget.warnings() if one.code == "energy-gained"]
    assert bool(warnings) != sound and all(one.startswith("the sponge has given") for one in warnings)
    assert all("a longer sponge reduces the gain" in one for one in warnings)


@usual_scheme
def test_resumed_run_has_the_rate_of_its_start(make_tank, scheme):
    """Though it was built with another, of the waves of a longer run, which scheme and water know by then."""
    waves = make_tank(length=2.0, cells=8, n=4)
    gammas = [profile(waves.plane.x - 1.0, width=1.0, strength=strength) for strength in (2.0, 5.0)]
    one, other = (sponged(scheme, gamma) for gamma in gammas)
    start, found = waves.state(0.1 * np.cos(np.pi * waves.plane.x / 2), 0.3 * waves.plane.x), []
    state = advanced(waves, other, start, steps=1, dt=0.05)
    waves.damp(gammas[1])
    other.damping.state = one.damping.state
    for each in (one, other):
        found.append(block_of(waves, (2, 0.1, each.step(waves, state, 0.05, 0.05))))
        waves.damp(gammas[0])
    assert found[0].psi == pytest.approx(found[1].psi, abs=1e-9)
    assert found[0].damped == pytest.approx(found[1].damped, rel=1e-6) and gammas[1].max() == 2.0


def test_dissipation_of_a_sponge_is_continued_with_other_numerics(make_tank):
    """Oracle: the same budget, whose numerics stay what they are."""
    waves = make_tank(length=2.0, cells=8, n=4)
    gamma = profile(waves.plane.x, width=2.0, strength=2.0)
    start = waves.state(0.1 * np.cos(np.pi * waves.plane.x / 2), 0 * waves.plane.x)
    state, budget, rows = watched(waves, Simpson4(), start, gamma=gamma, steps=9, dt=0.05)
    after = EnergyBudget(waves, record=Memory())
    after.change_numerics(budget.state, renewed=True)
    block = block_of(waves, (10, 0.5, sponged(Simpson4(), gamma).step(waves, state, 0.45, 0.05)))
    for one in (budget, after):
        one.record(block)
    assert after.state.dissipated == pytest.approx(budget.state.dissipated, rel=1e-12)
    assert after.state.dissipated > 1.1 * rows[-1, TAKEN] > 0.01 * rows[0, TOTAL]


@pytest.mark.parametrize(("threshold", "order"), [(0.0, 3), (np.inf, 4)], ids=["penalty", "alone"])
def test_energy_and_mass_of_damped_nonlinear_waves(make_tank, threshold, order):
    """Between fixed walls: what is lost is what sponge and penalty have taken, to the error of scheme and integral.

    Where a penalty acts what the sponge takes is seen from one trace, to the third order.
    """
    waves = make_tank(length=2.0, cells=8, n=4)
    q, p = waves.state(0.1 * np.cos(np.pi * waves.plane.x / 2), 0 * waves.plane.x)
    gamma, start = profile(waves.plane.x - 1.0, width=1.0, strength=2.0), waves.energy(q, p, 0.0)
    counts, missing = (20, 30, 45), []
    for count in counts:
        penalty = EdgePenalty(waves, SurfaceFlow(waves), cell_size=0.25, dt=1.0 / count, threshold=threshold)
        told = {"gamma": gamma, "steps": count, "dt": 1.0 / count, "sinks": [penalty]}
        state, _, rows = watched(waves, Simpson4(), (q, p), **told)
        assert rows[-1, TAKEN] - penalty.energy_taken > 0.1 * start
        assert (penalty.energy_taken > 0.0) == (threshold == 0.0)
        missing.append(abs(start - waves.energy(state.q, state.p, 1.0) - rows[-1, TAKEN]))
        assert waves.total_mass(state.q) == pytest.approx(waves.total_mass(q), rel=1e-14)
    assert missing[-1] < 1e-5 * start
    assert -fitted_slope(counts, missing) > order - 0.35


# ---------------------------------------------------------------- reflection
@pytest.mark.parametrize(("kd", "most"), [(0.5, 0.02), (1.0, 0.01), (2.0, 0.005), (4.0, 0.01)])
def test_a_sponge_of_one_wave_length_reflects_less_than_2_percent(kd, most):
    """Of the default strength, in the frequency domain; and shorter waves less still."""
    operators = Operators(Beach(kd, 1.0))
    assert operators.reflection(1.0) < most
    assert operators.reflection(1.5) < 0.01


def test_a_beach_beneath_a_short_sponge_reflects_less():
    """Half a wave long, of half the default strength: as the page on sponges has it."""
    flat, beach = (Beach(1.0, 0.5, cells=8, **more) for more in ({}, SLOPE))
    beach.vertical_order = 4
    assert [Operators(one).reflection(1.0) for one in (flat, beach)] == pytest.approx([0.182, 0.107], abs=0.01)


def test_the_reflection_in_time_is_that_of_the_frequency_domain():
    beach = Beach(1.0, 1.0, cells=12)
    found = in_time(beach, beach.linear(paddle(beach, 0.01)))
    assert found == pytest.approx(Operators(beach).reflection(1.0), abs=2e-4) and found < 0.01


@pytest.mark.parametrize(("strength", "width"), [(8.0, 0.01), (2.0, 2.0), (100.0, 12.0), (0.2, 12.0)])
def test_reflection_of_an_abrupt_strong_or_weak_sponge_is_that_of_the_frequency_domain(strength, width):
    """Of 12 m and of waves 6.3 m long; at a jump it is Fresnel's."""
    beach, x = Beach(1.0, 2.0, cells=8), 0.01 * (np.arange(1256) + 0.5)
    beach.gamma = strength * np.clip((beach.plane.x - beach.start) / width, 0.0, 1.0)
    gamma = strength * np.clip(np.append(-1.0, x) / width, 0.0, 1.0)
    found = reflection(gamma, 0.01, omega=beach.omega, depth=1.0, gravity=9.81)
    assert found == pytest.approx(Operators(beach).reflection(1.0), rel=0.25)
    index = np.sqrt(1 + 1j * strength / (beach.k * group_velocity(beach.k, 1.0, 9.81)))
    assert width > 1.0 or found == pytest.approx(abs((1 - index) / (1 + index)), rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("steepness", [0.01, 0.1])
def test_nonlinear_waves_are_reflected_as_linear_ones(steepness):
    beach = Beach(2.0, 1.0, cells=12)
    found = in_time(beach, beach.nonlinear(paddle(beach, steepness)))
    assert found == pytest.approx(Operators(beach).reflection(1.0), abs=1e-3)


# ---------------------------------------------------------------- footprints
def basin_of(kind="quadrilaterals", angle=0.0, order=2):
    """Return a basin of 4 m by 1 m, and the side of its paddle."""
    footprint, side = rectangle(4.0, 1.0, (8, 2), kind=kind, angle=angle)
    return Plane(footprint, order), side


def cells_beyond(plane, x):
    dim = plane.mesh.topology.dim
    return mesh.locate_entities(plane.mesh, dim, lambda places: places[0] > x - 1e-9)


@pytest.mark.parametrize("kind", ["quadrilaterals", "triangles"])
def test_a_group_at_the_end_is_an_end_sponge(kind):
    """The nearest point of a straight inner edge is straight ahead: its points are the other points' neighbours."""
    plane, _ = basin_of(kind)
    distance, width = distance_from_edge(plane, cells_beyond(plane, 2.5))
    assert distance == pytest.approx(np.maximum(plane.x - 2.5, 0.0), abs=1e-12)
    assert width == pytest.approx(1.5)


@pytest.mark.parametrize("beyond", [-1.0, 9.0])
def test_empty_group_or_whole_mesh_is_refused(beyond):
    plane, _ = basin_of()
    with pytest.raises(InputError, match="empty, or the whole mesh"):
        distance_from_edge(plane, cells_beyond(plane, beyond))


def test_a_negative_rate_is_refused_with_its_place():
    plane, _ = basin_of()
    with pytest.raises(InputError, match=r"gamma = -1 1/s at x = 4 m"):
        checked(plane, np.where(plane.x > 3.9, -1.0, 0.0))
    with pytest.raises(InputError, match="gamma = nan"):
        checked(plane, np.full(plane.owned, np.nan))


@pytest.mark.parametrize("piston", ["linear", "nonlinear"])
def test_end_sponge_is_measured_from_the_paddle_of_a_turned_basin(piston):
    """Oracle: the same basin with its paddle at x = 0 and no wall that moves; this one is turned."""
    sponge, case = EndSponge(length=1.5, strength=2.0), SimpleNamespace(tank=None, ends=[SimpleNamespace(period=None)])
    (straight, _), (plane, side) = basin_of(), basin_of(angle=0.7)
    expected = build_sponge(case, sponge, None, SimpleNamespace(plane=straight, wall=Wall()))
    wall = Wall(LinearPaddle(AT_REST, side=side))
    if piston == "nonlinear":
        wall = Wall(Paddle(AT_REST, plane=plane, reach=2.0, side=side))
    found = build_sponge(case, sponge, None, SimpleNamespace(plane=plane, wall=wall))
    assert expected == pytest.approx(2.0 * np.clip((straight.x - 2.5) / 1.5, 0.0, 1.0) ** 2, abs=1e-12)  # of 4 m
    assert expected.max() == pytest.approx(2.0) and found == pytest.approx(expected, abs=1e-12)


def test_a_basin_with_a_sponge_is_the_slice_with_it():
    """Waves uniform in y, linear: the same elevations to the basin's iterative tolerance."""
    (basin, _), footprint = basin_of(order=3), Slice(4.0, 8, comm=MPI.COMM_SELF)
    surfaces = []
    for plane in (basin, Plane(footprint.mesh, 3, footprint.chart)):
        waves = LinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=10)
        start = waves.state(0.1 * np.cos(np.pi * plane.x / 4), 0 * plane.x)
        scheme = sponged(StormerVerlet(), profile(plane.x - 2.0, width=2.0, strength=2.0))
        state = advanced(waves, scheme, start, steps=20, dt=0.03)
        eta = waves.elevation(state.q, state.p, 0.6)
        surfaces.append([eta[np.argmin(np.abs(plane.x - one))] for one in np.unique(basin.x.round(9))])
    assert np.abs(np.subtract(*surfaces)).max() < 1e-9


def figures_of_sponges():
    """Return the energy taken and a moment of nonlinear waves; a moment of distances in a corner, and its width."""
    footprint = Slice(3.0, 12, comm=MPI.COMM_WORLD)
    plane = Plane(footprint.mesh, 3, footprint.chart)
    tolerances = Tolerances(stage=1e-12, interior=1e-13)
    waves = NonlinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=4, tolerances=tolerances)
    gamma, start = (
        profile(plane.x - 1.0, width=2.0, strength=2.0),
        waves.state(0.1 * np.cos(np.pi * plane.x / 3), 0 * plane.x),
    )
    state, _, rows = watched(waves, Simpson4(), start, gamma=gamma, steps=2, dt=0.075)
    space = Plane(mesh.create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [4.0, 1.0]], [8, 4], mesh.CellType.triangle), 2)
    corner = mesh.locate_entities(space.mesh, 2, lambda x: (x[0] > 2.5 - 1e-9) & (x[1] > 0.5 - 1e-9))
    distance, width = distance_from_edge(space, corner)
    moments = plane.sum(state.q * np.cos(plane.x)), space.sum(distance * np.cos(space.x))
    return [rows[-1, TAKEN], *moments, width]


def test_a_sponge_is_the_same_on_any_number_of_ranks(on_ranks):
    """Energy taken and elevation of nonlinear waves to the solves' tolerance; distances in a corner group exactly."""
    alone = figures_of_sponges()
    assert alone[0] > 5e-4 and alone[3] == pytest.approx(0.5)
    for together in on_ranks(figures_of_sponges):
        assert together == pytest.approx(alone, rel=1e-9)


# ---------------------------------------------------------------- in a case
@pytest.mark.parametrize(
    ("sponge", "tank", "sentence"),
    [
        ({"type": "end", "length": 12.0}, {}, "sponge.length = 12.0: must be below the tank's length, 10 m"),
        ({"type": "end", "length": 2.0}, {"type": "ring"}, "a ring has no end"),
        ({"type": "end", "length": 2.0, "strength": 1.0, "period": 2.0}, {}, "sponge.strength is given"),
        ({"type": "group"}, {}, "needs a basin"),
        ({"type": "formula", "gamma": "2*z"}, {}, "unknown name"),
        ({"type": "end", "length": -1.0}, {}, "greater than or equal to"),
    ],
)
def test_invalid_sponge_is_refused(sponge, tank, sentence):
    with pytest.raises(ValueError, match=sentence):
        case_of(tank={"length": 10.0, "depth": 1.0, **tank}, sponge=sponge)


def test_the_strength_is_that_given_or_that_for_a_wave():
    """Deep water of period T: c_g = g T / (4 pi), lambda = g T² / (2 pi); with no wave known, it is the sponge's."""
    tank = SliceTank(length=500.0, depth=100.0)
    length = 9.81 * 3.0**2 / (2 * np.pi)
    speed = 9.81 * 3.0 / (4 * np.pi)
    assert EndSponge(length=2.0, strength=0.7).strength_for(2.0, tank) == 0.7
    wanted = pytest.approx(15 * speed / np.sqrt(20.0 * length), rel=1e-6)
    assert EndSponge(length=20.0, period=3.0).strength_for(20.0, tank, paddle=9.0) == wanted
    assert GroupSponge().strength_for(20.0, tank, paddle=3.0) == wanted
    assert EndSponge(length=length).strength_for(length, tank) == pytest.approx(15 * speed / length, rel=1e-6)


def test_the_paddles_period_is_that_of_its_motion():
    tank = SliceTank(length=10.0, depth=1.0)
    motion = ramped(sinusoid(0.1, 1.7), 3.4)
    assert paddle_period(motion.velocity, duration=40.0, tank=tank) == pytest.approx(1.7, rel=0.02)
    along = np.linspace(0.0, 1.0, 5)
    segments = paddle_period(lambda t: np.outer(motion.velocity(t), along), duration=40.0, tank=tank)
    assert segments == pytest.approx(1.7, rel=0.02)
    assert paddle_period(np.zeros_like, duration=40.0, tank=tank) is None
    for f in (17.0, 31.3, 64.0, 1000.0):  # Hz; it is looked at 31 times a second
        fast = paddle_period(lambda t, f=f: np.cos(2 * np.pi * f * t), duration=6.0, tank=tank)
        assert 1 / fast == pytest.approx(f, rel=0.02)


SEA = {"type": "irregular", "significant_height": 0.04, "spectrum": {"type": "jonswap", "peak_period": 1.6}}
WAVE = {"type": "oblique-wave", "wave_amplitude": 0.02, "period": 1.3, "angle": 20.0}
BASIN = {"type": "basin", "depth": 1.0, "layout": {"type": "rectangle", "length": 20.0, "width": 2.0}}


@pytest.mark.parametrize(
    ("motion", "tank"),
    [
        ({"type": "bichromatic", "heights": [0.02, 0.05], "periods": [1.3, 1.7]}, {"length": 20.0, "depth": 1.0}),
        (SEA | {"components": 60}, {"length": 20.0, "depth": 1.0}),
        (WAVE, BASIN),
        (SEA | {"type": "directional-irregular", "components": 60, "spreading": 20.0}, BASIN),
        (
            {"type": "reflected-focus", "linear_crest": 0.05, "focus_x": 6.0, "focus_time": 25.0}
            | {"components": 40, "spectrum": SEA["spectrum"]},
            BASIN,
        ),
    ],
    ids=["bichromatic", "irregular", "oblique", "directional", "reflected"],
)
def test_period_of_the_paddle_does_not_depend_on_the_duration(motion, tank):
    """That of its lines, which is what a long time of it shows, to the line: they are 4 % apart."""
    wall = ({"type": "segmented-piston", "segment": 0.1} if tank is BASIN else {"type": "piston"}) | {"motion": motion}
    numerics = {"cells": None, "cell_size": 1.0}
    short, long = (case_of(wall, tank=tank, duration=one, numerics=numerics).ends[0] for one in (7.0, 31.0))
    assert short.period == long.period
    again = 60 / 0.9375  # s, the period of the seas
    shown = paddle_period(lambda t: long.rates(t)[1], duration=again, tank=long.tank)
    assert long.period == pytest.approx(shown, rel=0.05)
