"""What a sweep took: wall times of trials, and what its workers did, out of `timing.jsonl`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from apo_bench.io.csv_file import write_csv
from apo_bench.io.reading import each_line
from apo_bench.records.checked import timing_of
from apo_bench.report.figures.chart import WIDTH, Panel
from apo_bench.report.page.markup import Html, Table, html
from apo_bench.statistics.rates import rank

PARTS = ("compile_s", "demonstrate_s", "trial_s")
LEFT, RIGHT, STEP = 118, 16, 20
"""Where the axis begins and ends, and from one line to the next, px."""
COLUMNS = ("scenario", "method", "trials", "trial_5_s", "trial_median_s", "trial_95_s", "trial_sum_s")


@final
@dataclass(frozen=True)
class Times:
    """Wall times of the trials of a scenario by a method, demonstration and compilation left out, [s]."""

    scenario: str
    method: str
    trials: int
    low: float
    median: float
    high: float
    """The 5th, 50th and 95th percentile."""
    total: float


@final
@dataclass(frozen=True)
class Work:
    """What a worker did."""

    host: str
    worker: str
    trials: int
    busy_s: float

    @property
    def rows_per_minute(self) -> float:
        return 60.0 * self.trials / self.busy_s if self.busy_s > 0 else 0.0


def read_timing(folder: Path) -> list[dict[str, Any]]:
    """The lines of trials that were timed; none if there is no such file.

    Raises:
        InputError: The file cannot be read, or a line is none; one sentence with file, line and field.
    """
    path = folder / "timing.jsonl"
    if not os.path.lexists(path):
        return []
    lines = [timing_of(line, f"{path}, line {number}") for number, line in each_line(path, "table of timings")]
    return [line for line in lines if line["trial_s"] is not None]


def times(lines: Iterable[Mapping[str, Any]]) -> tuple[Times, ...]:
    """One per scenario and method, sorted as `tally` sorts."""
    groups: dict[tuple[str, str], list[float]] = {}
    for line in lines:
        groups.setdefault((str(line["scenario"]), str(line["method"])), []).append(float(line["trial_s"]))
    order = sorted(groups, key=lambda key: (key[0], rank(key[1]), key[1]))
    return tuple(_times(*key, groups[key]) for key in order)


def work(lines: Iterable[Mapping[str, Any]]) -> tuple[Work, ...]:
    """One per host and worker."""
    groups: dict[tuple[str, str], list[float]] = {}
    for line in lines:
        busy = sum(float(line.get(part) or 0.0) for part in PARTS)
        groups.setdefault((_known(line.get("host")), _known(line.get("worker"))), []).append(busy)
    return tuple(Work(*key, len(groups[key]), sum(groups[key])) for key in sorted(groups))


def time_table(found: Sequence[Times]) -> Table:
    """For people."""
    head = ("scenario", "method", "n", "5 % are below [s]", "median [s]", "95 % are below [s]", "together [min]")
    rows: list[tuple[object, ...]] = [
        (t.scenario, t.method, t.trials, f"{t.low:.2f}", f"{t.median:.2f}", f"{t.high:.2f}", f"{t.total / 60:.1f}")
        for t in found
    ]
    return Table(head, rows, words=2)


def work_table(found: Sequence[Work]) -> Table:
    """For people."""
    rows: list[tuple[object, ...]] = [
        (w.host, w.worker, w.trials, f"{w.busy_s / 60:.1f}", f"{w.rows_per_minute:.1f}") for w in found
    ]
    return Table(("host", "worker", "rows", "busy [min]", "rows per minute"), rows, words=2)


def write_times(found: Sequence[Times], path: Path) -> None:
    """One line per scenario and method."""
    write_csv(path, COLUMNS, ((t.scenario, t.method, t.trials, t.low, t.median, t.high, t.total) for t in found))


def time_panels(found: Sequence[Times]) -> list[Panel]:
    """A panel per scenario, with one axis for all."""
    most = _round(max((t.high for t in found), default=0.0))
    by_scenario: dict[str, list[Times]] = {}
    for t in found:
        by_scenario.setdefault(t.scenario, []).append(t)
    return [_panel(scenario, own, most) for scenario, own in by_scenario.items()]


def _panel(scenario: str, own: Sequence[Times], most: float) -> Panel:
    def x(seconds: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * seconds / most

    said, y = [], 14
    for t in own:
        tip = f"{t.method}: median {t.median:.2f} s, 90 % between {t.low:.2f} and {t.high:.2f} s, n {t.trials}"
        said.append(f'<text x="0" y="{y + 4}">{html(t.method[:18])}</text>')
        said.append(f'<line class="seen" x1="{x(t.low):.1f}" x2="{x(t.high):.1f}" y1="{y}" y2="{y}"/>')
        said.append(
            f'<circle class="dot" style="--c:var(--ink)" cx="{x(t.median):.1f}" cy="{y}" r="4.5">'
            f"<title>{html(tip)}</title></circle>"
        )
        y += STEP
    for share in (0.0, 0.5, 1.0):
        at = f'x="{LEFT + (WIDTH - LEFT - RIGHT) * share:.1f}" y="{y + 8}" text-anchor="middle"'
        said.append(f'<text class="soft" {at}>{most * share:g}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    said.append(f'<text class="soft" x="{middle}" y="{y + 22}" text-anchor="middle">wall time of a trial [s]</text>')
    low, high = min(t.trials for t in own), max(t.trials for t in own)
    return Panel(f"{scenario}; n {low if low == high else f'{low} to {high}'}", Html("".join(said)), y + 28)


def _round(x: float) -> float:
    """The next larger of 0.1, 0.2, 0.4, 1, 2, 4, 10, .."""
    size = next(10.0**k for k in range(-1, 12) if 10.0**k * 10 > x)
    return next(size * step for step in (1, 2, 4, 10) if size * step >= x)


def _times(scenario: str, method: str, seconds: Sequence[float]) -> Times:
    import numpy as np

    low, median, high = map(float, np.percentile(seconds, (5, 50, 95)))
    return Times(scenario, method, len(seconds), low, median, high, float(sum(seconds)))


def _known(x: object) -> str:
    return "" if x is None else str(x)
