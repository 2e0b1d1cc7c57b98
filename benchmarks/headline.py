"""Keep the headline: `python benchmarks/headline.py [runs/headline_contact [--full runs/headline_full]]`.

Takes a sweep of benchmarks/headline.toml (`make headline`) and writes benchmarks/results/headline/ (rows, table, what
was run), then from these docs/results/headline.md, its figure, and the sentence with the figure in README.md and
docs/index.md; without a sweep it writes the pages again from the rows that are kept. With a second sweep, of the same
grid at fidelity full, it also writes how far the verdicts of the two agree. `--trials N` takes the first N seeds of a
sweep that is not at its end.
"""

from __future__ import annotations

import argparse
import json
import lzma
import shutil
import statistics as middle
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import read_timing, tally
from apo_bench.benchmark.analysis.paired import paired
from apo_bench.benchmark.report.report import report
from apo_bench.records.run.run_folder import read_records
from benchmarks.headline_figure import draw_look
from benchmarks.headline_look import block, look_at
from benchmarks.headline_page import page
from benchmarks.headline_tables import agreed, lasting, worked_s

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results" / "headline"
PAGE = ROOT / "docs" / "results" / "headline.md"
FIGURE = ROOT / "docs" / "pictures" / "headline.png"
BLOCKS = {
    ROOT / "README.md": ("docs/pictures", "docs/results/headline.md"),
    ROOT / "docs" / "index.md": ("pictures", "results/headline.md"),
}
"""Pages with the sentence and the figure: where pictures are from there, and where all numbers are."""
BEGIN = "<!-- written by benchmarks/headline.py -->"
END = "<!-- until here -->"
LEFT_OUT = ("reached", "thresholds")
"""Not kept of a row: the poses reached are most of its size, the thresholds are those of the scenario."""
EARLIER = "*The two sections below are of an earlier run than the tables above.*"
LASTING = "## How long it takes"

TrialRecord = Mapping[str, Any]


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path, nargs="?", help="the sweep of benchmarks/headline.toml")
    asked.add_argument("--full", type=Path, help="a sweep of the same grid at fidelity full")
    asked.add_argument("--trials", type=int, help="how many seeds to take")
    given = asked.parse_args()
    agreement = kept_agreement(of_these=given.folder is None)
    if given.folder is not None:
        with tempfile.TemporaryDirectory() as copy:
            shorten(given.folder, Path(copy), given.trials)
            keep(Path(copy))
            if given.full:
                agreement = [*lasting(Path(copy), given.full), *agreed(given.full, Path(copy))]
    write(agreement)


def shorten(folder: Path, copy: Path, trials: int | None) -> None:
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
    """Keep rows, table and what was run."""
    rows = read_records(folder)
    KEPT.mkdir(parents=True, exist_ok=True)
    shutil.copy(report(folder).tables["cells"], KEPT / "table.csv")
    (KEPT / "run.json").write_text(json.dumps(what_was_run(folder, rows), indent=2) + "\n", encoding="utf-8")
    lines = sorted(json.dumps({k: v for k, v in row.items() if k not in LEFT_OUT}) for row in rows)
    packed = lzma.compress("".join(f"{line}\n" for line in lines).encode(), preset=9 | lzma.PRESET_EXTREME)
    (KEPT / "rows.jsonl.xz").write_bytes(packed)


def kept_rows() -> list[dict[str, Any]]:
    """The rows that are kept; `reached` and `thresholds` are left out."""
    lines = lzma.decompress((KEPT / "rows.jsonl.xz").read_bytes()).splitlines()
    return [json.loads(line) for line in lines]


def write(agreement: Sequence[str]) -> None:
    """Write the page, the figure and the first look, all from what is kept."""
    rows = kept_rows()
    look = look_at(tally(rows))
    ran = json.loads((KEPT / "run.json").read_text(encoding="utf-8"))
    draw_look(look, FIGURE)
    PAGE.write_text("\n".join(page(look, paired(rows, ("paper",)), ran, agreement)).rstrip() + "\n", encoding="utf-8")
    for path, (pictures, link) in BLOCKS.items():
        before, rest = path.read_text(encoding="utf-8").split(BEGIN)
        kept = "\n".join([BEGIN, "", *block(look, pictures, link), "", END])
        path.write_text(before + kept + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote {PAGE}, {FIGURE}, and the first look in {' and '.join(map(str, BLOCKS))}")


def what_was_run(folder: Path, rows: Sequence[TrialRecord]) -> dict[str, Any]:
    """Versions, grids, code and times; the command is the one that does it again."""
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    times = read_timing(folder)
    spent: dict[tuple[str, str], list[float]] = {}
    for t in times:
        spent.setdefault((t["scenario"], t["method"]), []).append(t["trial_s"])
    trials = run["grids"][0]["trials"]
    return {
        "command": f"make headline TRIALS={trials} FIDELITY={run['grids'][0]['fidelity']}",
        **{key: run[key] for key in ("schema", "grids", "versions", "python", "platform", "content")},
        "rows": len(rows),
        "replays": sum(row["sim_time_s"] is not None for row in rows),
        "simulated_hours": round(sum(row["sim_time_s"] or 0.0 for row in rows) / 3600, 1),
        "worker_hours": round(sum(map(worked_s, times)) / 3600, 2),
        "workers": len({t["worker"] for t in times}),
        "median_trial_s": {f"{s}, {m}": round(middle.median(x), 3) for (s, m), x in sorted(spent.items())},
    }


def kept_agreement(of_these: bool) -> list[str]:
    """The comparison of two fidelities that the page has; of other rows than these, it says so."""
    _, title, rest = PAGE.read_text(encoding="utf-8").partition(LASTING)
    if of_these or EARLIER in rest or not title:
        return [f"{title}{rest}"]
    return [title, "", EARLIER, rest.rstrip()]


if __name__ == "__main__":
    main()
