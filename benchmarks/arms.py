"""How often each arm assembles the same tasks: `python benchmarks/arms.py FOLDER [FOLDER ...]`.

Takes sweeps of benchmarks/arms.toml, one for each arm, whole or not, and writes docs/results/arms.md: successes of
every arm, scenario and method, with Wilson's 95 % interval over the scenarios, and how the other trials ended.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import wilson
from apo_bench.records import TrialRecord
from apo_bench.records.run.run_folder import read_records
from benchmarks.made_with import mujoco_of, with_mujoco

PAGE = Path(__file__).parents[1] / "docs" / "results" / "arms.md"
SAID = """\
# Arms

Written by `python benchmarks/arms.py` from sweeps of `benchmarks/arms.toml`, one for each arm that comes with the
benchmark. Success: the finished assembly is right; clearance of 0.25 mm per side, held by friction, simulated near
contacts only (`--fidelity near-contact`). `oracle` is told the true goals; `contact` corrects poses that were seen with
noise of 0, 1 and 2 mm and degrees, half of the trials shown by careless humans. The seeds are the same for every arm.
The last lines have 95 % intervals (Wilson).
What [`arm check`](../guide/arm.md#what-was-measured) says of each arm stands in the guide.
"""


class Count(NamedTuple):
    """Successes of trials."""

    won: int
    trials: int

    def text(self) -> str:
        return f"{self.won} of {self.trials}"

    def rate(self) -> str:
        low, high = wilson(self.won, self.trials)
        return f"{100 * self.won / self.trials:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folders", nargs="+", type=Path)
    folders = asked.parse_args().folders
    rows = [row for folder in folders for row in read_records(folder)]
    written = page([row for row in rows if row["success"] is not None])
    PAGE.write_text(with_mujoco(written, mujoco_of(folders)), encoding="utf-8")
    print(f"Wrote {PAGE}")


def page(rows: Sequence[TrialRecord]) -> str:
    """Trials whose demonstration failed are not among the rows."""
    arms = list(dict.fromkeys(str(row["arm"]) for row in rows))
    return "\n".join([SAID, *_table(arms, rows), "", *_failures(arms, rows), ""])


def _table(arms: Sequence[str], rows: Sequence[TrialRecord]) -> list[str]:
    places = sorted({(row["scenario"], *_way(row)) for row in rows})
    lines = [
        f"| scenario | method | level | {' | '.join(f'`{arm}`' for arm in arms)} |",
        f"|---|---|---|{'---|' * len(arms)}",
    ]
    for scenario, method, noise_level in places:
        found = _counts(arms, [row for row in rows if (row["scenario"], *_way(row)) == (scenario, method, noise_level)])
        lines.append(_line(f"{scenario} | `{method}` | {noise_level}", [found[arm].text() for arm in arms]))
    for method, noise_level in sorted({_way(row) for row in rows}):
        found = _counts(arms, [row for row in rows if _way(row) == (method, noise_level)])
        lines.append(_line(f"**all** | `{method}` | {noise_level}", [found[arm].rate() for arm in arms]))
    return lines


def _way(row: TrialRecord) -> tuple[str, str]:
    """Method and level; the oracle meets none."""
    return row["method"], "any" if row["method"] == "oracle" else f"{row['noise_mm']:g}"


def _counts(arms: Sequence[str], rows: Sequence[TrialRecord]) -> Mapping[str, Count]:
    of = {arm: [row["success"] for row in rows if row["arm"] == arm] for arm in arms}
    return {arm: Count(sum(map(bool, found)), len(found)) for arm, found in of.items()}


def _line(first: str, rest: Sequence[str]) -> str:
    return f"| {first} | {' | '.join(rest)} |"


def _failures(arms: Sequence[str], rows: Sequence[TrialRecord]) -> list[str]:
    how = Counter(
        (str(row["arm"]), row["scenario"], row["failure_stage"], row["failure_code"])
        for row in rows
        if not row["success"]
    )
    if not how:
        return ["No trial failed."]
    said = [
        f"- `{arm}`, {scenario}: {stage}: {code}, {n} times"
        for (arm, scenario, stage, code), n in sorted(how.items(), key=str)
    ]
    return ["How the others ended:", "", *said]


if __name__ == "__main__":
    main()
