"""How far a sweep is: a bar with an estimate and live rates on a terminal, a line a minute anywhere else."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, final

from apo_bench.io import clean
from apo_bench.records import KEY, Row, look_up

Count = Callable[[Row], None]
"""Takes every row as it comes."""
BESIDE = tuple(column for column in KEY if column not in ("seed", "level", "level_deg"))
"""What tells the lines of the table apart; its columns are levels."""
FRAME = 6
"""Lines of the terminal that are not cells: the bar, the head, a line for what does not fit."""
PER_SECOND = 2.0
EVERY_S = 60.0
"""Between two lines where there is no terminal."""


@contextmanager
def progress(total: int) -> Iterator[Count]:
    """Show how many of `total` trials have ended, how long the rest will take, and success by cell.

    The cells that fit the terminal are those that had a trial last.
    """
    if not sys.stderr.isatty() or total == 0:
        yield _lines(total)
        return
    from rich.console import Console, Group
    from rich.live import Live
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True, markup=False)
    bar = Progress(
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("trials,"),
        TimeElapsedColumn(),
        TextColumn("gone,"),
        TimeRemainingColumn(),
        TextColumn("to go"),
        console=console,
        speed_estimate_period=600.0,
    )
    task = bar.add_task("", total=total)
    rates = Rates()

    def picture() -> Group:
        return Group(bar.get_renderable(), rates.table(max(1, console.size.height - FRAME)))

    def count(row: Row) -> None:
        rates.count(row)
        bar.advance(task)

    with Live(get_renderable=picture, console=console, refresh_per_second=PER_SECOND, transient=True):
        yield count


def _lines(total: int) -> Count:
    """Says every minute how many trials have ended, and when the rest will have at this pace."""
    began = printed = time.monotonic()
    ended = 0

    def count(row: Row) -> None:
        nonlocal printed, ended
        ended += 1
        now = time.monotonic()
        if now - printed >= EVERY_S:
            printed = now
            gone_min = (now - began) / 60
            left_min = gone_min * (total - ended) / ended
            sys.stderr.write(f"{ended} of {total} trials in {gone_min:.0f} min, about {left_min:.0f} min to go\n")
            sys.stderr.flush()

    return count


@final
class Rates:
    """Successes and trials by cell, as they come."""

    def __init__(self) -> None:
        self._lines: dict[tuple[Any, ...], dict[tuple[float, float], tuple[int, int]]] = {}
        """Line -> level -> successes, trials; the line that had a trial last comes last."""

    def count(self, row: Row) -> None:
        """Add a row; one whose demonstration went wrong counts for nothing."""
        if row["success"] is None or row["level"] is None or row["level_deg"] is None:
            return
        line = tuple(look_up(row, name) for name in BESIDE)
        cells = self._lines.pop(line, {})
        self._lines[line] = cells
        level = (row["level"], row["level_deg"])
        won, of = cells.get(level, (0, 0))
        cells[level] = (won + bool(row["success"]), of + 1)

    def table(self, most: int) -> Any:
        """The lines that had a trial last, `most` of them, sorted; what is the same in all is left out."""
        from rich.table import Table

        lines = dict(sorted(list(self._lines.items())[-most:]))
        varying = [i for i, name in enumerate(BESIDE) if name == "method" or len({k[i] for k in self._lines}) > 1]
        levels = sorted({level for cells in lines.values() for level in cells})
        table = Table(box=None, pad_edge=False, header_style="dim")
        for i in varying:
            table.add_column(BESIDE[i].removesuffix("_mm"), no_wrap=True)
        for mm, deg in levels:
            name = f"{mm:g}" if mm == deg or deg == 0.0 else f"{mm:g}, {deg:g}"
            table.add_column(f"level {name}" if (mm, deg) == levels[0] else name, justify="right", no_wrap=True)
        for line, cells in lines.items():
            table.add_row(
                *[f"{line[i]:g}" if isinstance(line[i], float) else clean(str(line[i])) for i in varying],
                *("{}/{}".format(*cells[level]) if level in cells else "" for level in levels),
            )
        if len(self._lines) > len(lines):
            table.add_row(f"and {len(self._lines) - len(lines)} more", style="dim")
        return table
