"""All that a report says in numbers about who succeeds, in one call."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.records import Row
from apo_bench.statistics.levels.curves import Area, AreaDifference, area_differences, areas, curves
from apo_bench.statistics.levels.half_level import HalfLevel, half_levels
from apo_bench.statistics.paired import REFERENCES, Paired, paired
from apo_bench.statistics.rates import Cell, tally


@final
@dataclass(frozen=True)
class Summary:
    """Each sorted as `tally` sorts; nothing of it depends on chance or on the order of rows."""

    cells: tuple[Cell, ...]
    pairs: tuple[Paired, ...]
    half_levels: tuple[HalfLevel, ...]
    areas: tuple[Area, ...]
    area_differences: tuple[AreaDifference, ...]


def summary(rows: Iterable[Row], references: Sequence[str] = REFERENCES) -> Summary:
    """Rates, pairs, half levels and areas of rows.

    Args:
        references: The methods that every other one is compared with.

    Raises:
        InputError: A trial is there twice.
    """
    rows = list(rows)
    over_levels = curves(rows)
    return Summary(
        cells=tally(rows),
        pairs=paired(rows, references),
        half_levels=half_levels(over_levels),
        areas=areas(over_levels),
        area_differences=area_differences(over_levels, references),
    )
