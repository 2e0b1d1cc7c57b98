"""How numbers and places are said in tables."""

from collections.abc import Callable
from typing import Any

from apo_bench.records.method import knows_truth
from apo_bench.report.tables.table import Column
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import Interval, Place, Rate
from apo_bench.statistics.settings import cell_place, setting_of


def millimetres(x: float | None) -> str | None:
    """`0.012`: to a thousandth."""
    return None if x is None else f"{x:.3f}"


def signed(x: float, digits: int) -> str:
    """`+4.0`; what is nothing to so many digits has no minus."""
    return f"{round(x, digits) + 0.0:+.{digits}f}"


def points(difference: float | None, interval: Interval) -> str | None:
    """`+4.0 (-0.3 to +9.1)`."""
    if difference is None:
        return None
    said, low, high = (signed(100 * x, 1) for x in (difference, *interval))
    return f"{said} ({low} to {high})"


def p_text(p: float | None) -> str | None:
    """`0.031`, `< 0.001`."""
    if p is None:
        return None
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def share(r: Rate) -> str | None:
    """`12 of 13 (66.7 to 98.6 %)`."""
    low, high = r.interval
    return f"{r.successes} of {r.trials} ({100 * low:.1f} to {100 * high:.1f} %)" if r.trials else None


def span(interval: Interval, digits: int = 3) -> str:
    """`0.213 to 0.301`."""
    return f"{interval.low:.{digits}f} to {interval.high:.{digits}f}"


def percents(interval: Interval, digits: int = 1) -> str:
    """`91.5 to 99.0 %`."""
    return f"{100 * interval.low:.{digits}f} to {100 * interval.high:.{digits}f} %"


def place_columns(of: Callable[[Any], Any] = cell_place, levels: bool = True) -> tuple[Column, ...]:
    """Where something was measured: for people scenario, conditions and method, for files every axis by itself.

    Args:
        of: From an item to its place, or to the setting of its curve, which has no level.
    """

    def axis(name: str, called: str = "") -> Column:
        return Column(called or name, value=lambda x: getattr(of(x), name))

    return (
        axis("scenario")._replace(head="scenario", words=True, group=True),
        Column("", "conditions", text=lambda x: ", ".join(setting_of(of(x)).conditions()), words=True, group=True),
        *map(axis, ("clearance_mm", "noise", "relations", "careless")),
        *((axis("level", "level_mm"), axis("level_deg")) if levels else ()),
        axis("method")._replace(head="method", words=True),
        axis("grasp"),
        axis("fidelity"),
        axis("looks"),
        axis("robot_error"),
    )


def level_text(x: Any) -> str:
    """`0.5`, or `0.5 mm, 1 deg`, of anything that has a place; `any` of the oracle, which meets none."""
    place = x if isinstance(x, Place) else cell_place(x)
    return "any" if knows_truth(place.method) else level_label(place.level, place.level_deg, place.noise)


def interval_columns(
    of: Callable[[Any], Interval | None], low: str = "low_95", high: str = "high_95"
) -> tuple[Column, ...]:
    """Both ends of an interval, for files."""

    def ends(x: Any) -> tuple[float | None, float | None]:
        return of(x) or (None, None)

    return Column(low, value=lambda x: ends(x)[0]), Column(high, value=lambda x: ends(x)[1])


def rate_columns(of: Callable[[Any], Rate], names: tuple[str, str, str, str, str]) -> tuple[Column, ...]:
    """Trials, successes, rate and its interval, for files; an empty name is left out."""
    values = (
        lambda x: of(x).trials,
        lambda x: of(x).successes,
        lambda x: of(x).rate,
        lambda x: of(x).interval.low,
        lambda x: of(x).interval.high,
    )
    return tuple(Column(name, value=value) for name, value in zip(names, values, strict=True) if name)
