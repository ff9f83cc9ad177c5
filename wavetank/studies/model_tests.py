"""The criterion for regular waves of model tests: height and period at the gauges of a comparison."""

from collections.abc import Sequence

from pandas import concat
from rich.table import Table
from xarray import DataArray

from wavetank.analysis.signals import common_clock
from wavetank.analysis.validation import FEWEST_PLACES, agreeing, regular_waves
from wavetank.base.errors import InputError
from wavetank.plots.tables import REGULAR, terminal_table


def regular_waves_of(pairs: Sequence[tuple[DataArray, DataArray]], start: float | None) -> list[Table | str]:
    """Return a table and lines on pairs of a computed and a measured record after ``start`` [s], by gauge.

    There are none for fewer than three gauges.
    """
    if len(pairs) < FEWEST_PLACES:
        return []
    shared = [common_clock(pair) for pair in pairs]
    try:
        waves = [regular_waves([both[n] for both in shared], start=start) for n in range(2)]
    except InputError as error:
        return [f"height and period of regular waves: {error}"]
    names = [measured.gauge.item() for _, measured in pairs]
    computed, measured = (one.assign_coords(gauge=names) for one in waves)
    both = {"computed": computed, "reference": measured}
    rows = concat([one.to_dataframe().reset_index().assign(record=name) for name, one in both.items()])
    uniform = "; ".join(f"{name} {_places(one.uniform)}" for name, one in both.items())
    return [
        terminal_table(rows.sort_index(kind="stable"), REGULAR),
        f"height and period within 5 % of their means over the gauges (IMO MSC.1/Circ.1200, 4.4.4): {uniform}",
        f"computed height and period within 5 % of the reference: {_places(agreeing(computed, measured))}",
    ]


def _places(met: DataArray) -> str:
    """Return the number of gauges that meet a criterion, and the names of the others if some do."""
    failing = f", not at {', '.join(met.gauge.values[~met.values])}" if met.any() and not met.all() else ""
    return f"at {int(met.sum())} of {met.size} gauges{failing}"
