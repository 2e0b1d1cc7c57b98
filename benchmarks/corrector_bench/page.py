"""The page of the documentation that says what `python benchmarks/corrector.py` measured, missed targets first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.corrector_bench.problems import FIGURES
from benchmarks.corrector_bench.rows import TrialRecord, restored

TIMES = ("P1", "P2", "P4", "P3")
"""Rows of the table of times, in its order."""


def page(document: Mapping[str, Any]) -> str:
    """Markdown out of `benchmarks/results/corrector.json`."""
    versions = ", ".join(f"{package} {version}" for package, version in document["versions"].items())
    suites = document["suites"]
    rows = [row for suite in suites.values() for row in restored(suite["rows"])]
    runs = ", ".join(f"{name} at `{suite['commit']}` with {suite['draws']}" for name, suite in suites.items())
    missed = [row for row in rows if row.met is False]
    judged = sum(row.met is not None for row in rows)
    return "\n".join(
        [
            "# The corrector in numbers",
            "",
            "Written by `python benchmarks/corrector.py` on Fig. 2, 3 and 6 of the paper, at 2 mm and 1 degree where "
            "nothing else is said; observations are Gaussian around an exactly consistent truth. Suites, each with its "
            f"commit and its draws per figure: {runs}. "
            f"{versions}; {document['machine']}. Every number is in `benchmarks/results/corrector.json`.",
            "",
            f"{judged - len(missed)} of {judged} targets are met." + ("" if missed else " None is missed."),
            "",
            *_missed(missed),
            "",
            "## Time of a correction",
            "",
            "Public calls only, from an observation to its `Correction` with test and posterior. Each number is the "
            "time over that of `paper` on the same draw, called through the same door: medians of ratios, processor "
            "time, one thread; in brackets milliseconds. Peers run in processes of their own, on a tenth of the draws, "
            "`paper` beside them in turn; what leaves a contact open by more than 0.1 mm is not timed. `contact` is "
            "compiled by Numba.",
            "",
            "| call | asked | Fig. 2 | Fig. 3 | Fig. 6 |",
            "|---|---|---|---|---|",
            *_times(rows),
            "",
            "## What its results are worth",
            "",
            "The worst of all problems; sigma are standard deviations of the stated noise.",
            "",
            "| what | asked | measured | problems |",
            "|---|---|---|---|",
            *_worst(row for row in rows if row.id not in TIMES),
            "",
        ]
    )


def _missed(rows: Iterable[TrialRecord]) -> Iterable[str]:
    for row in rows:
        measured = row.note or ("-" if row.value is None else f"{row.value:.3g}")
        yield f"- Missed, {row.problem}: {row.what}: {measured}, asked {row.target}"


def _times(rows: Sequence[TrialRecord]) -> Iterable[str]:
    for what in dict.fromkeys(row.what for id in TIMES for row in rows if row.id == id):
        of = {row.problem: row for row in rows if row.what == what}
        targets = list(dict.fromkeys(of[name].target for name in FIGURES if name in of))
        asked = ", ".join(target.removeprefix("<= ") for target in targets)
        yield f"| {what} | {asked} | " + " | ".join(_cell(of.get(name)) for name in FIGURES) + " |"


def _cell(row: TrialRecord | None) -> str:
    if row is None:
        return ""
    if row.value is None:
        return row.note
    return f"{row.value:.3f} ({row.detail['ms']:.2f})"


def _worst(rows: Iterable[TrialRecord]) -> Iterable[str]:
    groups: dict[tuple[str, str], list[TrialRecord]] = {}
    for row in rows:
        if row.target and row.value is not None:
            groups.setdefault((row.what, row.target), []).append(row)
    for (what, target), group in groups.items():
        values = [row.value for row in group if row.value is not None]
        low = min(values)
        high = max(values)
        said = f"{low:.3g} to {high:.3g}" if ".." in target else f"{high if target.startswith('<=') else low:.3g}"
        names = [row.problem for row in group]
        where = ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} more"
        yield f"| {what.replace('|', chr(92) + '|')} | {target.replace('..', 'to')} | {said} | {where} |"
