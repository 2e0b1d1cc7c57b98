"""The tables of the headline: rates of cells as Markdown, pairs, and how far two fidelities agree."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.benchmark.analysis import Cell, Paired, Rate, read_timing, wilson
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.records import is_uncorrected

Of = Callable[[Cell], Hashable]


def rates(cells: Sequence[Cell], heads: Sequence[str], row: Callable[[Cell], tuple[str, ...]], column: Of) -> list[str]:
    """Success in percent: a line per `row`, in the order of the cells, and a column per `column`, sorted.

    Args:
        cells: One at each place of the table.
        heads: What the entries of `row` are called.
        row: The words at the beginning of a cell's line.
        column: What a cell's column is called.
    """
    columns = sorted({column(cell) for cell in cells}, key=lambda name: (isinstance(name, str), name))
    found: dict[tuple[str, ...], dict[Hashable, str]] = {}
    for cell in cells:
        found.setdefault(row(cell), {})[column(cell)] = both(cell)
    named = [f"{name:g}" if isinstance(name, float) else str(name) for name in columns]
    return [
        f"| {' | '.join((*heads, *named))} |",
        "|---" * len(heads) + "|--:" * len(columns) + "|",
        *(f"| {' | '.join((*words, *(own.get(name, '') for name in columns)))} |" for words, own in found.items()),
    ]


def both(cell: Cell) -> str:
    """Success in percent, and what is as demonstrated where that is less."""
    success, shown = (f"{100 * (rate or 0.0):.0f}" for rate in (cell.rate, cell.demonstrated_rate))
    return success if success == shown else f"{success} ({shown})"


def widths(trials: int) -> str:
    """What one cell does not tell, for rates of 0, a half and 1."""
    low, half, high = (wilson(round(share * trials), trials) for share in (0.0, 0.5, 1.0))
    return (
        f"Of {trials} trials, 0 % has a 95 % interval (Wilson) of 0 to {100 * low.high:.0f} %, 50 % one of "
        f"{100 * half.low:.0f} to {100 * half.high:.0f} %, 100 % one of {100 * high.low:.0f} to 100 %."
    )


def whole(cells: Iterable[Cell]) -> str:
    """Success of several cells together, with its interval."""
    here = list(cells)
    rate = Rate(sum(cell.successes for cell in here), sum(cell.trials for cell in here))
    return f"{rate.successes} of {rate.trials} ({100 * rate.interval.low:.0f} to {100 * rate.interval.high:.0f} %)"


def together(cells: Sequence[Cell], heads: Sequence[str], row: Callable[[Cell], tuple[str, ...]]) -> list[str]:
    """As `rates`, with a column per scenario, and one of all with its interval."""
    lines = rates(cells, heads, row, lambda cell: cell.scenario)
    groups: dict[tuple[str, ...], list[Cell]] = {}
    for cell in cells:
        groups.setdefault(row(cell), []).append(cell)
    added = ["all |", "---|", *(f"{whole(own)} |" for own in groups.values())]
    return [f"{line} {more}" if more != "---|" else f"{line}{more}" for line, more in zip(lines, added, strict=True)]


def differing(pairs: Sequence[Paired], methods: Sequence[str]) -> list[str]:
    """Cells in which a method that corrects ends otherwise than `paper` at any seed."""
    asked = [p for p in pairs if p.place.method in methods and not is_uncorrected(p.place.method) and p.pairs]
    apart = [p for p in asked if p.only_method or p.only_reference]
    lines = [
        f"Corrected poses against those of `paper` over the same seeds, in the {len(apart)} of {len(asked)} cells in "
        "which they do not end alike at every seed: at how many one alone was right, difference of the rates in points "
        "with Tango's 95 % interval, and McNemar's exact p, adjusted for all comparisons with `paper` (Holm).",
        "",
        "| scenario | human | level | noise | method | pairs | it alone | `paper` alone | difference | p adjusted |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for p in apart:
        at = p.place
        low, high = (100 * x for x in p.interval)
        lines.append(
            f"| {at.scenario} | {'human_error_scale' if at.human_error_scale else 'careful'} | {at.noise_mm:g} | {at.noise} | `{at.method}` "
            f"| {p.pairs} | {p.only_method} | {p.only_reference} "
            f"| {100 * (p.difference or 0.0):+.1f} ({low:+.1f} to {high:+.1f}) | {p.p_adjusted:.2g} |"
        )
    return lines


def lasting(contact: Path, full: Path) -> list[str]:
    """How long 40 seeds take: counted, where there are as many, else in proportion."""
    lines = [
        "## How long it takes",
        "",
        "Work of all processes, shared evenly among two: what a sweep of 40 seeds takes on two cores.",
        "",
        "| fidelity | seeds | trials | minutes | 40 seeds |",
        "|---|---|---|---|---|",
    ]
    for name, folder in (("contact", contact), ("full", full)):
        times = read_timing(folder)
        first = min(t["seed"] for t in times)
        some = [t for t in times if t["seed"] < first + 40]
        seeds = len({t["seed"] for t in some})
        minutes = sum(map(worked_s, some)) / 2 / 60
        lines.append(f"| {name} | {seeds} | {len(some)} | {minutes:.1f} | {minutes * 40 / seeds:.0f} min |")
    return [*lines, ""]


def worked_s(timing: Mapping[str, Any]) -> float:
    return sum(timing[part] or 0.0 for part in ("trial_s", "demonstrate_s", "compile_s"))


def agreed(full: Path, contact: Path) -> list[str]:
    """How far verdicts at fidelity near-contact are those at fidelity full."""
    found = compare(full, contact)
    lines = [
        "## Fidelity",
        "",
        "The same trials at fidelity `full`, in which every step of every motion is simulated: how many have the same "
        "verdict, and how many the same verdict, stage and code; Wilson's 95 % interval of the first. Trials of "
        "one seed share their random numbers; the last column counts the seeds with the same verdict in all trials.",
        "",
        "| scenario | trials | same verdict | interval | same ending | right at `full` alone | at `contact` alone "
        "| seeds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for a in found.agreements:
        low, high = a["same_verdict_low_95"], a["same_verdict_high_95"]
        lines.append(
            f"| {a['scenario']} | {a['trials']} | {a['same_verdict']} ({100 * (a['same_verdict_rate'] or 0):.1f} %) "
            f"| {100 * low:.1f} to {100 * high:.1f} % | {a['same_stage_and_code']} | {a['right_in_first_alone']} "
            f"| {a['right_in_second_alone']} | {a['same_verdicts_in_all']} of {a['seeds']} |"
        )
    return lines
