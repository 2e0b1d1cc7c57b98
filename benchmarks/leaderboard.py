"""The committed leaderboard: `python -m benchmarks.leaderboard`.

Entries are those of `apo-bench score METHOD --out benchmarks/entries/METHOD.json`; rows lie in folders beside them,
which are not committed.

Writes docs/results/leaderboard.md with its figure, and its first ten lines into the README. Tracks in which the three
best methods lie within two points of each other, `oracle` apart, tell methods apart no more: they are there for
regression tests and say `overall = false`; --marks says which these are.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from apo_bench.benchmark.scoring.entry import Entry
from apo_bench.benchmark.scoring.leaderboard import leaderboard_table, ranked, read_entries, write_leaderboard
from benchmarks.provenance import with_mujoco

ROOT = Path(__file__).resolve().parents[1]
ENTRIES = ROOT / "benchmarks" / "entries"
PAGE = ROOT / "docs" / "results" / "leaderboard.md"
README = ROOT / "README.md"
BEGIN = "<!-- written by benchmarks/leaderboard.py -->\n"
END = "<!-- until here: leaderboard -->\n"
FIRST = 10
WITHIN = 2.0
"""Points."""
BEST = 3


def entries() -> list[Entry]:
    """Those that are committed, of which none is left out."""
    of, left_out = read_entries(ENTRIES)
    if left_out:
        raise SystemExit("\n".join(left_out))
    return of


def for_regression(of: Sequence[Entry]) -> Iterator[str]:
    """Tracks that tell the best methods apart no more, by name."""
    for name in sorted({name for entry in of for name in entry.tracks}):
        scores = [e.tracks[name].score for e in of if name in e.tracks and e.name != "oracle"]
        best = sorted(scores, reverse=True)[:BEST]
        if len(best) == BEST and round(best[0] - best[-1], 6) <= WITHIN:
            yield name


def first_lines() -> str:
    """The first ten lines of the table, as the README has them."""
    lines = ranked(entries())[:FIRST]
    return "\n".join(leaderboard_table(lines).markdown()) + "\n"


def in_readme(text: str) -> str:
    """The README with the first lines of the table."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{first_lines()}\n{END}{rest.split(END)[1]}"


def write_page(page: Path) -> None:
    """The page and its figure, and what the rows were simulated with."""
    write_leaderboard(entries(), page)
    versions = sorted({entry.versions["mujoco"] for entry in entries()})
    page.write_text(with_mujoco(page.read_text(encoding="utf-8"), versions), encoding="utf-8")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--marks", action="store_true", help="only say which tracks are for regression tests")
    if asked.parse_args().marks:
        print("\n".join(for_regression(entries())))
        return
    write_page(PAGE)
    README.write_text(in_readme(README.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
