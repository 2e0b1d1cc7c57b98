"""The committed leaderboard: `python -m benchmarks.leaderboard`.

Entries are those of `apo-bench score METHOD --out benchmarks/entries/METHOD.json`; rows lie in folders beside them,
which are not committed.

Writes docs/results/leaderboard.md with its figure, and its first ten lines into the README. Tracks in which the three
best methods lie within two points of each other, without `oracle`, no longer separate methods: they are regression
tests and have `overall = false`; --marks lists them.
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
    """Tracks that no longer separate the best methods, by name."""
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


def outcome(of: Sequence[Entry]) -> str:
    """Two sentences: how good the best methods are that do not have the true poses, and the bound."""
    scores = {line.entry.name: line.entry.overall[0] for line in ranked(of) if line.entry.overall}
    bound = scores.pop("oracle")
    (first, best), (second, next_best) = [*scores.items()][:2]
    return (
        f"`{first}` leads with a score of {best:.1f} of 100, before `{second}` with {next_best:.1f}. The bound is "
        f"`oracle`, which has the true poses, with {bound:.1f}.\n\n"
    )


def write_page(page: Path) -> None:
    """The page and its figure, with what came out and what the rows were simulated with."""
    of = entries()
    write_leaderboard(of, page)
    head, rest = page.read_text(encoding="utf-8").split("\n\n", 1)
    text = with_mujoco(f"{head}\n\n{outcome(of)}{rest}", sorted({entry.versions["mujoco"] for entry in of}))
    page.write_text(text, encoding="utf-8")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--marks", action="store_true", help="list the tracks that are regression tests")
    if asked.parse_args().marks:
        print("\n".join(for_regression(entries())))
        return
    write_page(PAGE)
    README.write_text(in_readme(README.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
