"""What a sweep file asks for, and how much of it stands on a page: `python benchmarks/asked.py`.

Writes the sentence anew on the pages whose counts are kept in files, from these counts and the sweep files as they are
now. Whoever changes a sweep file without running it again is told so by tests/benchmarks/test_asked.py.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.sweeps.grid import load_all, units
from apo_bench.benchmark.sweeps.sweep_file import read_sweep

ROOT = Path(__file__).resolve().parents[1]
FIRST = "<!-- seeds -->"
LAST = "<!-- end of seeds -->"
"""Around the sentence on a page."""


class Kept(NamedTuple):
    """A page, the file with its counts, and the sweep files that it is of."""

    page: Path
    counts: Path
    sweeps: tuple[Path, ...]
    place: tuple[str, ...]
    """Columns that name a cell."""


ROBUST = Kept(
    ROOT / "docs" / "results" / "robust.md",
    ROOT / "benchmarks" / "results" / "robust.csv",
    (ROOT / "benchmarks" / "robust.toml",),
    ("noise", "noise_level", "clearance_mm", "human_error_scale", "scenario", "method", "max_reobservations"),
)
ROUND = Kept(
    ROOT / "docs" / "results" / "round.md",
    ROOT / "benchmarks" / "results" / "round.csv",
    (ROOT / "benchmarks" / "round.toml", ROOT / "benchmarks" / "gearbox.toml"),
    ("scenario", "clearance_mm", "human_error_scale", "noise_level", "contact_source", "method"),
)


def main() -> None:
    for kept in (ROBUST, ROUND):
        text = kept.page.read_text(encoding="utf-8")
        before, _, rest = text.partition(FIRST)
        kept.page.write_text(before + block(kept) + rest.partition(LAST)[2], encoding="utf-8")
        print(f"Wrote {kept.page}")


def block(kept: Kept) -> str:
    """The sentence for a page, between the two marks."""
    return f"{FIRST}\n{said(found_trials(kept), asked_trials(kept.sweeps, kept.place))}\n{LAST}"


def said(found: Mapping[tuple[Any, ...], int], asked: Mapping[tuple[Any, ...], int]) -> str:
    """How many of the seeds of the sweep files were run: one sentence."""
    pairs = Counter((min(found.get(place, 0), trials), trials) for place, trials in asked.items())
    if all(n == m for n, m in pairs):
        return "It holds every seed of every cell of the sweep file."
    each = (f"{n} of {m} seeds in {cells} cell{'s' * (cells > 1)}" for (n, m), cells in sorted(pairs.items()))
    return f"It is a part of what the sweep file asks for: {', '.join(each)}."


def asked_trials(sweeps: Iterable[Path], place: tuple[str, ...]) -> Counter[tuple[Any, ...]]:
    """How many seeds the sweep files ask for in each cell; a trial that stands there twice counts once."""
    trials = {trial for path in sweeps for trial in _trials(path)}
    return Counter(_key(trial, place) for trial in trials)


def found_trials(kept: Kept) -> dict[tuple[Any, ...], int]:
    """How many trials with a verdict the kept counts have in each cell."""
    with kept.counts.open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    return {tuple(_value(line[name]) for name in kept.place): int(line["trials"]) for line in lines}


def _trials(path: Path) -> Iterator[Any]:
    grids = read_sweep(path)
    loaded = load_all(grids)
    for unit in units(grids, loaded):
        yield from unit


def _key(trial: Any, place: tuple[str, ...]) -> tuple[Any, ...]:
    own = {"noise_level": trial.noise_mm}
    return tuple(_value(own[name] if name in own else getattr(trial, name)) for name in place)


def _value(x: Any) -> Any:
    """Numbers as numbers, whether they come from a file or from settings."""
    try:
        return float(x)
    except (TypeError, ValueError):
        return str(x)


if __name__ == "__main__":
    main()
