"""Error and cost that two pilot runs predict, and the report of ``wavetank plan --trade``."""

import re

import numpy as np
import pytest
from case_builders import build_case, piston
from mpi4py import MPI
from ranks import CHECKOUT
from tanks import written

from examples.paper.delivery import gauge_error
from examples.scenes import executed, refined
from wavetank.base.errors import BreakdownError, InputError
from wavetank.case.reading import read_case
from wavetank.planning import trade as trades
from wavetank.planning.timing import time_steps
from wavetank.planning.trade import Pilot, Setting, Trade, measure_trade, pilot_record

NUMERICS = {"order": 3, "vertical_order": 6, "cells": 24, "dt": 0.04}
TANK, GAUGES = {"length": 6.0, "depth": 1.0}, [1.0, 3.0]
BED = {"type": "formula", "depth": "1.0 - 0.4 * exp(-(x - 3)**2)"}


def paddle(tank=TANK, **parts):
    """Return a case of a piston with complete numerics."""
    return build_case(tank, duration=6.0, wall=piston(1.5, 0.02, ramp=1.5), numerics=NUMERICS, **parts)


def by_hand(**changes):
    """Return a trade of an error of 1e-3 r^4 and a cost of 2 / r."""
    settings = Setting("cells, with dt", 1e-3, 1.5), Setting("dt", 9e-4, 1.19), Setting("tolerance", 1e-6, 1.06)
    trade = Trade(paddle(), 0.04, 1e-3, 1e-6, 4, (2.8, 2.0), {0.5: 4.0, 1.0: 2.0, 2.0: 1.0}, settings)
    return trade._replace(**changes)


def test_error_cost_and_ratio_of_powers():
    trade = by_hand()
    for ratio in (0.3, 0.7, 1.0, 1.4, 3.0):
        assert trade.error(ratio) == pytest.approx(1e-3 * ratio**4, rel=1e-2)
        assert trade.cost(ratio) == pytest.approx(2.0 / ratio)
        assert trade.ratio(trade.error(ratio)) == pytest.approx(ratio)
    assert trade.ratio(1e-7) == 0.0
    assert by_hand(costs={0.5: 16.0, 1.0: 2.0, 2.0: 1.0}).cost(0.25) == pytest.approx(128.0)


def test_best_setting_decreases_the_error_most_for_its_cost():
    """By hand: half of either part decreases the total by a sixth; a third of the cost is better."""
    assert by_hand().best_setting.name == "dt"
    assert by_hand(settings=by_hand().settings[::2]).best_setting.name == "cells, with dt"


def test_numerics_of_a_ratio_have_other_cells_and_a_step_as_stable():
    trade = by_hand()
    larger, same, smaller = (trade.numerics(ratio) for ratio in (2.0, 1.0, 0.5))
    assert (larger.cells, same.cells, smaller.cells) == (12, 24, 48)
    assert same.dt == 0.04 and 0.02 <= smaller.dt < 0.03 and 0.04 < larger.dt <= 0.08


@pytest.mark.parametrize("tank", [TANK, TANK | {"bed": BED}, "hump"])
def test_error_is_predicted_within_a_factor_of_three(tank):
    """On the cells of the case and on others; also over a bed, and of an initial surface. Oracle: refined numerics."""
    if tank == "hump":
        initial = {"type": "formula", "eta": "0.05 * exp(-(2 * x)**2)"}
        case = build_case(TANK, duration=4.0, initial=initial, gauges=GAUGES, numerics=NUMERICS | {"cells": 40})
    else:
        case = paddle(tank, gauges=GAUGES)
    trade = measure_trade(case, MPI.COMM_SELF)
    for ratio in (0.8, 1.2):
        chosen = case.model_copy(update={"numerics": trade.numerics(ratio)})
        run = executed(chosen)
        error = gauge_error(run.gauges[:, 0], run.gauges[:, 1:].T, executed(refined(chosen, run.dt)))
        predicted = trade.error(chosen.cell_size / case.cell_size)
        assert 1 / 3 < predicted / error < 3, (ratio, predicted, error)


def test_gauge_of_low_waves_does_not_count():
    """Records by hand: the second gauge has 1 % of the waves, and errors as large as its waves."""
    t = np.linspace(0.0, 6.0, 200)
    coarse, fine = (
        np.column_stack([t, (1 + one) * np.sin(t), 0.01 * (1 + 100 * one) * np.sin(t)]) for one in (2e-2, 1e-2)
    )
    cases = [paddle().model_copy(update={"numerics": by_hand().numerics(ratio)}) for ratio in (3.0, 2.0)]
    pilots = [Pilot(*each) for each in zip(cases, (coarse, fine), strict=True)]
    trade = trades._trade(paddle(), 0.04, pilots, {1.0: 1.0, 2.0: 0.5})
    assert trade.grid == pytest.approx(1e-2 / 1.01 / (3.0**4 - 2.0**4), rel=1e-3)


def test_parts_of_the_error_and_their_costs():
    """Records by hand: the vertical order changes them by 3 %; the worst gauge is the second; tolerance 1e-5."""
    t = np.linspace(0.0, 6.0, 200)
    case = paddle()
    case = case.model_copy(update={"numerics": case.numerics.model_copy(update={"tolerance": 1e-5})})
    coarse, fine, lower = (
        np.column_stack([t, one * np.sin(t), two * np.sin(t)]) for one, two in ((1.0, 1.08), (1.0, 1.0), (1.0, 1.1124))
    )
    cases = [case.model_copy(update={"numerics": by_hand().numerics(ratio)}) for ratio in (3.0, 2.0, 3.0)]
    pilots = [Pilot(*each) for each in zip(cases, (coarse, fine, lower), strict=True)]
    trade = trades._trade(case, 0.04, pilots, {0.5: 4.0, 1.0: 2.0, 2.0: 1.0})
    cells, step, order, solves = trade.settings
    assert cells.error == trade.grid == pytest.approx(0.08 / 65, rel=1e-2)
    assert (order.error, solves.error) == pytest.approx((0.01, 6e-5), rel=1e-2)
    assert trade.rest == pytest.approx(np.hypot(0.01, 6e-5), rel=1e-2)
    assert (cells.factor, step.factor, order.factor) == pytest.approx((2**0.25, 2**0.25, 2**0.5))


def test_flap_with_a_kink_has_the_error_of_its_vertical_order():
    """The error of n = 5 exceeds that of the cells. Oracle: refined numerics."""
    wall = {"type": "flap", "hinge": 0.4, "motion": {"type": "regular", "height": 0.02, "period": 1.5, "ramp": 1.5}}
    numerics = {"order": 4, "vertical_order": 5, "cells": 40, "dt": 0.02}
    case = build_case(TANK, duration=6.0, wall=wall, gauges=GAUGES, numerics=numerics)
    trade, run = measure_trade(case, MPI.COMM_SELF), executed(case)
    error = gauge_error(run.gauges[:, 0], run.gauges[:, 1:].T, executed(refined(case, run.dt)))
    assert trade.best_setting.name == "vertical_order" and trade.rest > 3 * trade.grid
    assert 1 / 3 < trade.error(1.0) / error < 6


def test_timed_steps_contain_loads_and_probes():
    case = paddle(gauges=GAUGES, loads=[{"on": "far wall"}], probes=[{"x": 3.0, "z": -0.5}])
    rare = case.model_copy(update={"output": case.output.model_copy(update={"probes_every": 20})})
    without = case.model_copy(update={"loads": (), "probes": ()})
    steps = {name: time_steps(one, MPI.COMM_SELF) for name, one in (("each", case), ("rare", rare), ("no", without))}
    assert steps["each"].below == steps["no"].below == 0 < steps["rare"].below
    assert len(steps["each"].run.diagnostics) == len(steps["no"].run.diagnostics) + 1


def test_pilot_runs_that_break_down_have_smaller_cells(monkeypatch):
    original, sizes = trades.pilot_record, []

    def breaking(case, comm):
        sizes.append(case.cells)
        if case.cells < 12:
            raise BreakdownError("t = 1 s: a wave breaks")
        return original(case, comm)

    monkeypatch.setattr(trades, "pilot_record", breaking)
    trade = measure_trade(paddle(gauges=GAUGES), MPI.COMM_SELF)
    assert trade.pilots == pytest.approx((2.0, 24 / 18)) and sizes == [9, 12, 18]
    assert trade.failed == ("0.667 or 0.5 m: t = 1 s: a wave breaks",)


def test_pilot_run_in_which_a_wave_breaks_is_not_used():
    """Although the case dissipates it."""
    changes = ["wall.motion.linear_crest=0.22", "run.duration=16", "numerics.cell_size=0.4", "numerics.dt=0.03"]
    case = read_case(CHECKOUT / "cases" / "breaking-group.toml", changes)
    assert case.run.on_breaking == "dissipate"
    with pytest.raises(BreakdownError, match="a wave breaks"):
        pilot_record(case, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("change", "why"), [({"duration": 0.2}, "fewer than 16 steps"), ({"wall": {"type": "fixed"}}, "at rest")]
)
def test_case_without_an_error_is_refused(change, why):
    parts = {"duration": 6.0, "wall": piston(1.5, 0.02, ramp=1.5), "gauges": GAUGES, "numerics": NUMERICS} | change
    with pytest.raises(InputError, match=why):
        measure_trade(build_case(TANK, **parts), MPI.COMM_SELF)


def test_order_is_at_most_that_of_the_scheme():
    case = build_case(TANK, duration=6.0, wall=piston(1.5, 0.02), gauges=GAUGES, numerics=NUMERICS)
    numerics = case.numerics.model_copy(update={"integrator": "stormer-verlet", "dt": 0.02})
    trade = measure_trade(case.model_copy(update={"numerics": numerics}), MPI.COMM_SELF)
    assert trade.order == 2 and measure_trade(case, MPI.COMM_SELF).order == 4


def test_pilot_runs_record_each_step():
    case = paddle(gauges=GAUGES)
    rare = case.model_copy(update={"output": case.output.model_copy(update={"gauges_every": 20})})
    np.testing.assert_array_equal(pilot_record(rare, MPI.COMM_SELF), pilot_record(case, MPI.COMM_SELF))


def test_ring_of_few_cells_has_smaller_cells_in_its_pilot_runs():
    initial = {"type": "stream-function", "steepness": 0.3}
    tank = {"type": "ring", "length": np.pi, "depth": 1.0}
    case = build_case(tank, duration=3.0, initial=initial, gauges=[0.0], numerics=NUMERICS | {"cells": 4, "order": 4})
    assert measure_trade(case, MPI.COMM_SELF).pilots == pytest.approx((1.0, 4 / 6))


def test_basin_without_gauges_is_refused():
    tank = {"type": "basin", "depth": 0.5, "layout": {"type": "rectangle", "length": 2.0, "width": 1.0}}
    with pytest.raises(InputError, match="the case needs a gauge"):
        measure_trade(build_case(tank, numerics={"order": 2, "dt": 0.02}), MPI.COMM_SELF)


@pytest.mark.parametrize("ranks", [1, 2])
def test_report_has_a_table_and_a_picture(ranks, tmp_path, wavetank):
    """Without gauges the error is that of the surface."""
    path, picture = written(tmp_path / "case.toml", paddle()), tmp_path / "trade.png"
    words = "plan", str(path), "--trade", "--out", str(picture)
    said = wavetank(*words, ranks=ranks)
    assert said.returncode == 0, said.stderr
    assert re.search(r"the case: [\d.]+ %, [\d.]+ CPU s; a tenth of this error: [\d.]+ times", said.stdout)
    assert re.search(r"pays most: (cells, with dt|dt|vertical_order|tolerance); half of its part", said.stdout)
    assert picture.stat().st_size > 10_000
    again = wavetank(*words)
    assert again.returncode == 2 and "trade.png: is there already" in again.stderr
    for out, why in (("x.txt", "must end in .png"), ("folder/x.png", "its folder does not exist")):
        refused = wavetank(*words[:-1], str(tmp_path / out))
        assert refused.returncode == 2 and why in refused.stderr


def test_trade_and_accuracy_exclude_each_other(tmp_path, wavetank):
    path = written(tmp_path / "case.toml", paddle())
    said = wavetank("plan", str(path), "--trade", "--accuracy", "0.01")
    assert said.returncode == 2 and "--trade and --accuracy exclude each other" in said.stderr
    assert wavetank("plan", str(path), "--out", str(tmp_path / "x.png")).returncode == 2
