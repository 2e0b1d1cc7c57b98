"""Write what errors of the robot itself cost: `python benchmarks/robot_errors.py FOLDER [FOLDER ...]`.

Takes sweeps of benchmarks/robot_errors.toml, whole or not, and writes docs/results/robot-errors.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.records import TrialConfig, TrialRecord
from benchmarks.provenance import count_revisions, mujoco_of, with_mujoco
from benchmarks.rates_by_condition import counted, fraction, group, rate_of, read_judged, table

PAGE = Path(__file__).parents[1] / "docs" / "results" / "robot-errors.md"
HEAD = """\
# Errors of the robot

With a robot error even `oracle`, which has the true poses, fails, since contacts correct the errors of the camera and
not those of the robot. A robot that [probes](../how/probing.md) estimates its own error: `contact+probe` succeeds in {}
trials with one.
"""
MEASURED = """
## Measurement

Written by `python benchmarks/robot_errors.py` from sweeps of `benchmarks/robot_errors.toml` and of parts of it.
Success: the finished assembly is right; the same seeds, no human error, clearance of 0.25 mm per side, and noise of
1 mm and 1 degree (1 sigma per axis) for all methods but `oracle`. Every trial draws a
[robot error](../guide/robot-error.md#errors-of-the-robot), in standard deviations, mm and degrees. The sweeps ran
with {} revision(s) of the package.
"""
SCENARIOS = ("peg_in_hole", "stick_in_tower", "carried_bridge")
USUAL = {"arm": "six_axis", "ft_sensor": TrialConfig.ft_sensor, "assumed_robot_error": TrialConfig.assumed_robot_error}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    folders = parser.parse_args().folders
    written = page(read_judged(folders), count_revisions(folders))
    PAGE.write_text(with_mujoco(written, mujoco_of(folders)), encoding="utf-8")
    print(f"Wrote {PAGE}")


def page(every: Sequence[TrialRecord], revisions: int) -> str:
    rows = [row for row in every if _is_usual(row)]
    methods = sorted({row["method"] for row in rows})
    errors = sorted({str(row["robot_error"]) for row in rows}, key=_by_size)
    whole = group(rows, lambda row: (row["robot_error"], row["method"]))
    each = group(rows, lambda row: (row["robot_error"], row["method"], row["scenario"]))
    times = group(rows, lambda row: (row["method"], row["scenario"]))
    probed = rate_of([row for row in rows if row["method"] == "contact+probe" and row["robot_error"] != "none"])
    heads = [f"`{method}`" for method in methods]
    lines = [
        HEAD.format(f"{probed.successes} of {probed.trials}"),
        "## All scenarios\n",
        *table(
            ("robot error", *heads),
            [[f"`{e}`", *(counted(rate_of(whole.get((e, m), []))) for m in methods)] for e in errors],
        ),
        "\n## Each scenario\n",
        *table(
            ("scenario", "robot error", *heads),
            [
                [scenario, f"`{e}`", *(fraction(rate_of(each.get((e, m, scenario), []))) for m in methods)]
                for scenario in SCENARIOS
                for e in errors
            ],
        ),
    ]
    cost = [[f"`{m}`", *(_median_s(times.get((m, scenario), [])) for scenario in SCENARIOS)] for m in methods]
    lines += ["\n## Simulated seconds of a trial, median over all errors\n", *table(("method", *SCENARIOS), cost)]
    others = group([row for row in every if not _is_usual(row)], _other_place)
    if others:
        lines += [
            "\n## Other sensors, assumptions, arms and scenarios\n",
            "The sensor is `--ft-sensor`, the assumption `--assumed-robot-error`.\n",
            *table(
                ("robot error", "arm", "sensor", "assumption", "scenario", "method", "successes"),
                [[*(f"`{name}`" for name in place), fraction(rate_of(of))] for place, of in sorted(others.items())],
            ),
        ]
    return "\n".join([*lines, MEASURED.format(revisions)])


def _is_usual(row: TrialRecord) -> bool:
    return row["scenario"] in SCENARIOS and all(row.get(key) == value for key, value in USUAL.items())


def _other_place(row: TrialRecord) -> tuple[str, ...]:
    return tuple(str(row.get(key)) for key in ("robot_error", *USUAL, "scenario", "method"))


def _median_s(rows: Sequence[TrialRecord]) -> str:
    seconds = [row["sim_time_s"] for row in rows if row["sim_time_s"] is not None]
    return f"{median(seconds):.0f}" if seconds else ""


def _by_size(error: str) -> tuple[bool, bool, str, float]:
    kind, _, size = error.partition("+")[0].partition(":")
    return kind != "none", "+" in error, kind, float(size.split("/")[0] or 0.0) if size else 0.0


if __name__ == "__main__":
    main()
