"""Format rates, differences and intervals for people."""

from apo_bench.benchmark.analysis.rates import Interval


def format_percent(rate: float | None, digits: int = 1) -> str:
    """Format a rate: `97.0 %`, or a dash for None; `100.0 %` and `0.0 %` only if the rate is exactly 1 or 0."""
    if rate is None:
        return "–"
    text = f"{100 * rate:.{digits}f}"
    least = 10.0**-digits
    if rate < 1.0 and float(text) == 100.0:
        return f"> {100 - least:.{digits}f} %"
    return f"< {least:.{digits}f} %" if rate > 0.0 and float(text) == 0.0 else f"{text} %"


def format_percent_interval(interval: Interval) -> str:
    """Format an interval: `91.5 to 99.0 %`."""
    return f"{100 * interval.low:.1f} to {100 * interval.high:.1f} %"


def format_signed(x: float, digits: int) -> str:
    """Format a number with its sign: `+4.0`; a number that rounds to 0 has no minus."""
    return f"{round(x, digits) + 0.0:+.{digits}f}"


def format_points(share: float | Interval) -> str:
    """Format a difference of rates, or its interval, in percentage points: `+4.0`, or `-0.3 to +9.1`."""
    ends = share if isinstance(share, tuple) else (share,)
    return " to ".join(format_signed(100 * x, 1) for x in ends)
