"""How rates, differences and levels are said."""

from apo_bench.records import RANGE
from apo_bench.statistics.rates import Cell, Interval, Rate


def percent(rate: float | None, digits: int = 1) -> str:
    """`97.0 %`, or a dash where nothing counted; only what is all or nothing says 100.0 or 0.0."""
    if rate is None:
        return "–"
    text = f"{100 * rate:.{digits}f}"
    least = 10.0**-digits
    if rate < 1.0 and float(text) == 100.0:
        return f"> {100 - least:.{digits}f} %"
    return f"< {least:.{digits}f} %" if rate > 0.0 and float(text) == 0.0 else f"{text} %"


def percents(interval: Interval, digits: int = 1) -> str:
    """`91.5 to 99.0 %`."""
    return f"{100 * interval.low:.{digits}f} to {100 * interval.high:.{digits}f} %"


def share(r: Rate) -> str | None:
    """`12 of 13 (66.7 to 98.6 %)`; None without a trial."""
    return f"{r.successes} of {r.trials} ({percents(r.interval)})" if r.trials else None


def signed(x: float, digits: int) -> str:
    """`+4.0`; what is nothing to so many digits has no minus."""
    return f"{round(x, digits) + 0.0:+.{digits}f}"


def points(difference: float | None, interval: Interval) -> str | None:
    """`+4.0 (-0.3 to +9.1)`."""
    if difference is None:
        return None
    middle, low, high = (signed(100 * x, 1) for x in (difference, *interval))
    return f"{middle} ({low} to {high})"


def failures(cell: Cell, most: int = 3) -> str:
    """`attach: force_stop 12, judge: gap 3`: the most frequent endings of trials that failed."""
    return ", ".join(f"{why} {count}" for why, count in list(cell.failures.items())[:most])


def level_label(level: float, level_deg: float, noise: str = "") -> str:
    """`0.5`, `0.5 mm, 1 deg` where the two differ, or `0.5 mm per ray` of the range finder."""
    if noise == RANGE:
        return f"{level:g} mm per ray"
    return f"{level:g}" if level == level_deg else f"{level:g} mm, {level_deg:g} deg"
