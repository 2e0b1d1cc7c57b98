"""What robots that feel found out about themselves, beside what their errors were drawn with."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.io.grouping import grouped
from apo_bench.records import Row, look_up, robot_sigmas, told_error
from apo_bench.statistics.rates import Place, order, place_of


@final
@dataclass(frozen=True)
class FeltSummary:
    """Of the trials of a cell in which a robot felt; lengths are root mean squares of vectors, angles alike."""

    place: Place
    trials: int
    touches: float
    """Mean."""
    refused: int
    """Touches that were not believed, all together."""
    felt_mm: float
    felt_deg: float
    """How far the base was believed to be off in the end."""
    sure_mm: float
    sure_deg: float
    """How far that may be wrong, as the robot says itself."""

    @property
    def drawn(self) -> tuple[float, float]:
        """What the true error was drawn with, [mm] and [deg]."""
        return _as_vector(self.place.robot_error)

    @property
    def told(self) -> tuple[float, float] | None:
        """What the robot was told, [mm] and [deg]; None if nothing."""
        said = told_error(self.place.stated_error, self.place.robot_error)
        return None if said is None else _as_vector(said)


def felt(rows: Iterable[Row]) -> tuple[FeltSummary, ...]:
    """One per cell of a method that feels, sorted as `tally` sorts."""
    groups = grouped((place, row) for row in rows if row.get("touches") is not None and (place := place_of(row)))
    return tuple(_summary(place, groups[place]) for place in sorted(groups, key=order))


def _summary(place: Place, rows: Sequence[Row]) -> FeltSummary:
    def column(name: str) -> list[float]:
        return [float(look_up(row, name)) for row in rows]

    sizes = (_root_mean_square(column(name)) for name in ("felt_mm", "felt_deg", "felt_sure_mm", "felt_sure_deg"))
    touches = math.fsum(column("touches")) / len(rows)
    return FeltSummary(place, len(rows), touches, int(sum(column("touches_refused"))), *sizes)


def _root_mean_square(sizes: Sequence[float]) -> float:
    return math.sqrt(math.fsum(x * x for x in sizes) / len(sizes))


def _as_vector(name: str) -> tuple[float, float]:
    """Root mean squares of vectors of three axes, of where hand and eye believe each other."""
    mm, deg = robot_sigmas(name).hand_eye
    return math.sqrt(3.0) * mm, math.sqrt(3.0) * deg
