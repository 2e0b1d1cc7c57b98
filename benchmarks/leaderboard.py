"""The committed leaderboard: `python -m benchmarks.leaderboard`.

Entries are those of `apo-bench score METHOD --trials 10 --out benchmarks/entries/METHOD.json`; the same command
continues an interrupted run, and more trials can be added. Records lie in folders beside them, which are not committed.

Writes docs/results/leaderboard.md with its figure, and its first ten lines into the README.
"""

from __future__ import annotations

from collections.abc import Sequence
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


def entries() -> list[Entry]:
    """Those that are committed, of which none is left out."""
    of, left_out = read_entries(ENTRIES)
    if left_out:
        raise SystemExit("\n".join(left_out))
    return of


def first_lines() -> str:
    """The first ten lines of the table, as the README has them."""
    lines = ranked(entries())[:FIRST]
    return "\n".join(leaderboard_table(lines).markdown()) + "\n"


def in_readme(text: str) -> str:
    """The README with the first lines of the table."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{first_lines()}\n{END}{rest.split(END)[1]}"


def outcome(of: Sequence[Entry]) -> str:
    """Return how good the best methods are that do not have the true poses, the bound, and which have few trials."""
    scores = {line.entry.name: line.score for line in ranked(of) if line.score is not None}
    bound = scores.pop("oracle")
    (first, best), (second, next_best) = [*scores.items()][:2]
    words = "{:.1f} ({:.1f} to {:.1f})"
    named = ", ".join(f"`{entry.name}`" for entry in of if entry.has_few_trials)
    few = f" Few trials of each condition so far: {named}." if named else ""
    return (
        f"`{first}` leads with a score of {words.format(*best)}, before `{second}` with {words.format(*next_best)}. "
        f"The bound is `oracle`, which has the true poses, with {words.format(*bound)}.{few}\n\n"
    )


def write_page(page: Path) -> None:
    """The page and its figure, with what came out and what the rows were simulated with."""
    of = entries()
    write_leaderboard(of, page)
    head, rest = page.read_text(encoding="utf-8").split("\n\n", 1)
    text = with_mujoco(f"{head}\n\n{outcome(of)}{rest}", sorted({entry.versions["mujoco"] for entry in of}))
    page.write_text(text, encoding="utf-8")


def main() -> None:
    write_page(PAGE)
    README.write_text(in_readme(README.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
