"""Write how often each arm assembles the same tasks: `python benchmarks/arms.py FOLDER [FOLDER ...]`.

Takes sweeps of benchmarks/arms.toml, one for each arm, whole or not, and writes docs/results/arms.md.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.records import TrialRecord
from benchmarks.provenance import mujoco_of, with_mujoco
from benchmarks.rates_by_condition import counted, group, rate_of, read_judged, table

PAGE = Path(__file__).parents[1] / "docs" / "results" / "arms.md"
HEAD = """\
# Arms

`contact` succeeds in {} trials with {} arms of the benchmark, `oracle`, which has the true poses, in {}. The seeds are
the same for every arm.
"""
MEASURED = """
## Measurement

Written by `python benchmarks/arms.py` from sweeps of `benchmarks/arms.toml`, one for each arm. Success: the finished
assembly is right; clearance of 0.25 mm per side, friction grasp, `--fidelity near-contact`. Noise is 1 sigma per axis.
Half of the demonstrations have human error. The last lines of the table have Wilson's 95 % intervals. The guide has the
results of [`arm check`](../guide/arm.md#measurements).
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    folders = parser.parse_args().folders
    PAGE.write_text(with_mujoco(page(read_judged(folders)), mujoco_of(folders)), encoding="utf-8")
    print(f"Wrote {PAGE}")


def page(rows: Sequence[TrialRecord]) -> str:
    arms = sorted({str(row["arm"]) for row in rows})
    heads = ("scenario", "method", "noise, mm and deg", *(f"`{arm}`" for arm in arms))
    rates = (rate_of([row for row in rows if row["method"] == method]) for method in ("contact", "oracle"))
    contact, oracle = (f"{rate.successes} of {rate.trials}" for rate in rates)
    head = HEAD.format(contact, len(arms), oracle)
    return "\n".join([head, *table(heads, _lines(arms, rows)), "", *_failures(rows), MEASURED])


def _lines(arms: Sequence[str], rows: Sequence[TrialRecord]) -> Iterator[list[str]]:
    keys = group(rows, lambda row: (row["scenario"], row["method"], str(row["arm"])))
    rates = {key: rate_of(each) for key, each in keys.items()}
    for scenario, method in sorted({key[:2] for key in rates}):
        found = [rates.get((scenario, method, arm)) for arm in arms]
        yield [scenario, f"`{method}`", "any", *(f"{r.successes} of {r.trials}" if r else "" for r in found)]
    whole = {key: rate_of(each) for key, each in group(rows, lambda row: (*_place(row), str(row["arm"]))).items()}
    for method, noise in sorted({key[:2] for key in whole}):
        yield ["**all**", f"`{method}`", noise, *(counted(whole.get((method, noise, arm))) for arm in arms)]


def _place(row: TrialRecord) -> tuple[str, str]:
    """Return method and noise level; the oracle meets no noise."""
    return row["method"], "any" if row["method"] == "oracle" else f"{row['noise_mm']:g}"


def _failures(rows: Sequence[TrialRecord]) -> list[str]:
    failed = [row for row in rows if not row["success"]]
    how = Counter((str(r["arm"]), r["scenario"], f"{r['failure_stage']}: {r['failure_code']}") for r in failed)
    if not how:
        return ["No trial failed."]
    lines = [f"- `{arm}`, {scenario}: {end}, {n} times" for (arm, scenario, end), n in sorted(how.items())]
    return ["The failures:", "", *lines]


if __name__ == "__main__":
    main()
