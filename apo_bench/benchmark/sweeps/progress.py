"""Show the progress of a sweep on the terminal, or as lines in a log."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from apo_bench.io import format_count

Count = Callable[[], None]
"""Called for every finished trial."""
EVERY_S = 60.0
"""Seconds between two lines if there is no terminal."""


@contextmanager
def show_progress(total: int) -> Iterator[Count]:
    """Show how many of `total` trials are finished, and how long the others will take."""
    if not sys.stderr.isatty() or total == 0:
        yield _show_lines(total)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), "trials,", TimeElapsedColumn(), "gone,", TimeRemainingColumn())
    with Progress(*columns, "to go", console=Console(stderr=True), speed_estimate_period=600.0, transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda: bar.advance(task)


def _show_lines(total: int) -> Count:
    """Return a counter that prints a line at the start, then every minute the progress and the remaining time."""
    if total:
        sys.stderr.write(f"0 of {total} trials\n")
        sys.stderr.flush()
    began = printed = time.monotonic()
    ended = 0

    def count() -> None:
        nonlocal printed, ended
        ended += 1
        now = time.monotonic()
        if now - printed >= EVERY_S:
            printed = now
            gone_min = (now - began) / 60
            left_min = gone_min * (total - ended) / ended
            sys.stderr.write(
                f"{ended} of {format_count(total, 'trial')} in {gone_min:.0f} min, about {left_min:.0f} min to go\n"
            )
            sys.stderr.flush()

    return count
