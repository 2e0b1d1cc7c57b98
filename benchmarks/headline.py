"""Keep the trials of the headline and write its page: `python benchmarks/headline.py [FOLDER [--full FULL]]`.

Takes a sweep of benchmarks/headline.toml (`make headline`) and writes benchmarks/results/headline/ (trials, table, what
ran), then docs/results/headline.md, its figure, and the summary in docs/index.md. Without a folder it writes the pages
from the kept trials; `python -m benchmarks.readme_table` then writes the table of README.md. With a second sweep, of
the same grid at fidelity full, it also writes how far the verdicts of the two agree. `--trials N` takes the first N
seeds.
"""

from __future__ import annotations

import argparse
import json
import lzma
import shutil
import statistics
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import read_timing, tally
from apo_bench.benchmark.analysis.paired import compare_pairs
from apo_bench.benchmark.report.report import write_report
from apo_bench.records.run.run_folder import read_records
from benchmarks.headline_figure import draw_summary
from benchmarks.headline_page import describe_fidelity, page
from benchmarks.headline_summary import block, summarise

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results" / "headline"
PAGE = ROOT / "docs" / "results" / "headline.md"
FIGURE = ROOT / "docs" / "pictures" / "headline.svg"
BLOCKS = {
    ROOT / "docs" / "index.md": ("pictures", "results/headline.md"),
}
"""Pages with the summary: the folder of pictures from there, and the page with all numbers."""
BEGIN = "<!-- written by benchmarks/headline.py -->"
END = "<!-- until here -->"
LEFT_OUT = ("final_poses", "thresholds")
"""Columns that are not kept: the poses reached are most of the size, the thresholds are those of the scenario."""
FIDELITY = "## Fidelity"
EARLIER = "*This section is of an earlier run than the tables above.*"

TrialRecord = Mapping[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="the sweep of benchmarks/headline.toml")
    parser.add_argument("--full", type=Path, help="a sweep of the same grid at fidelity full")
    parser.add_argument("--trials", type=int, help="number of seeds to take (all)")
    given = parser.parse_args()
    fidelity = kept_fidelity(given.folder is None)
    if given.folder is not None:
        with tempfile.TemporaryDirectory() as copy:
            copy_first_seeds(given.folder, Path(copy), given.trials)
            keep(Path(copy))
            if given.full:
                fidelity = describe_fidelity(given.full, Path(copy))
    write(fidelity)


def copy_first_seeds(folder: Path, copy: Path, trials: int | None) -> None:
    """Copy a sweep, or its first seeds."""
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    for grid in run["grids"]:
        grid["trials"] = trials or grid["trials"]
    end = run["grids"][0]["seed"] + run["grids"][0]["trials"]
    (copy / "run.json").write_text(json.dumps(run), encoding="utf-8")
    for name, lines in (("trials.jsonl", read_records(folder)), ("timing.jsonl", read_timing(folder))):
        kept = (json.dumps(line) for line in lines if line["seed"] < end)
        (copy / name).write_text("".join(f"{line}\n" for line in kept), encoding="utf-8")


def keep(folder: Path) -> None:
    """Keep trials, table and what ran."""
    rows = read_records(folder)
    KEPT.mkdir(parents=True, exist_ok=True)
    shutil.copy(write_report(folder).tables["conditions"], KEPT / "table.csv")
    (KEPT / "run.json").write_text(json.dumps(describe_run(folder, rows), indent=2) + "\n", encoding="utf-8")
    lines = sorted(json.dumps({k: v for k, v in row.items() if k not in LEFT_OUT}) for row in rows)
    packed = lzma.compress("".join(f"{line}\n" for line in lines).encode(), preset=9 | lzma.PRESET_EXTREME)
    (KEPT / "rows.jsonl.xz").write_bytes(packed)


def kept_rows() -> list[dict[str, Any]]:
    """Return the kept trials."""
    lines = lzma.decompress((KEPT / "rows.jsonl.xz").read_bytes()).splitlines()
    return [json.loads(line) for line in lines]


def write(fidelity: Sequence[str]) -> None:
    """Write the page, the figure and the summaries from what is kept."""
    rows = kept_rows()
    summary = summarise(tally(rows))
    ran = json.loads((KEPT / "run.json").read_text(encoding="utf-8"))
    draw_summary(summary, FIGURE)
    lines = page(summary, compare_pairs(rows, ("paper",)), ran, fidelity)
    PAGE.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    for path, (pictures, link) in BLOCKS.items():
        before, rest = path.read_text(encoding="utf-8").split(BEGIN)
        kept = "\n".join([BEGIN, "", *block(summary, pictures, link), "", END])
        path.write_text(before + kept + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote {PAGE}, {FIGURE}, and the summary in {' and '.join(map(str, BLOCKS))}")


def describe_run(folder: Path, rows: Sequence[TrialRecord]) -> dict[str, Any]:
    """Return versions, grids, code and times of a sweep, and the command that repeats it."""
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    times = list(read_timing(folder))
    spent: dict[tuple[str, str], list[float]] = {}
    for t in times:
        spent.setdefault((t["scenario"], t["method"]), []).append(t["trial_s"])
    worked_s = sum(t[part] or 0.0 for t in times for part in ("trial_s", "demonstrate_s", "compile_s"))
    trials = run["grids"][0]["trials"]
    return {
        "command": f"make headline TRIALS={trials} FIDELITY={run['grids'][0]['fidelity']}",
        **{key: run[key] for key in ("schema", "grids", "versions", "python", "platform", "content")},
        "rows": len(rows),
        "replays": sum(row["sim_time_s"] is not None for row in rows),
        "simulated_hours": round(sum(row["sim_time_s"] or 0.0 for row in rows) / 3600, 1),
        "worker_hours": round(worked_s / 3600, 2),
        "workers": len({t["worker"] for t in times}),
        "median_trial_s": {f"{s}, {m}": round(statistics.median(x), 3) for (s, m), x in sorted(spent.items())},
    }


def kept_fidelity(of_these: bool) -> list[str]:
    """Return the section on fidelity that the page has; for other trials than the kept ones it says so."""
    _, title, rest = PAGE.read_text(encoding="utf-8").partition(FIDELITY)
    if of_these or EARLIER in rest or not title:
        return [f"{title}{rest}"]
    return [title, "", EARLIER, rest.rstrip()]


if __name__ == "__main__":
    main()
