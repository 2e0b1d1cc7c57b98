"""Keep the headline: `python benchmarks/headline.py runs/headline_contact [--full runs/headline_full]`.

Takes a sweep of benchmarks/headline.toml (`make headline`) and writes benchmarks/results/headline/ (rows, table,
what was run), docs/results/headline.md with its figure, and the table in README.md. With a second sweep, of the same
grid at fidelity full, it also writes how far the verdicts of the two agree. `--trials N` takes the first N seeds of a
sweep that is not at its end.
"""

from __future__ import annotations

import argparse
import json
import lzma
import shutil
import statistics as middle
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench.records.method import as_seen
from apo_bench.records.run.run_folder import read_rows
from apo_bench.report.compare import compare
from apo_bench.report.figures.levels import success_figure
from apo_bench.report.figures.sheet import draw
from apo_bench.report.report import report
from apo_bench.statistics.paired import Paired, paired
from apo_bench.statistics.rates import Cell, rank, tally, wilson
from apo_bench.statistics.times import read_timing

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "headline"
PAGE, README = ROOT / "docs" / "results" / "headline.md", ROOT / "README.md"
FIGURE = ROOT / "docs" / "pictures" / "headline.png"
BEGIN, END = "<!-- written by benchmarks/headline.py -->", "<!-- until here -->"
LEFT_OUT = ("reached", "thresholds")
"""Not kept of a row: the poses reached are most of its size, the thresholds are those of the scenario."""
METHODS = ("none", "search", "paper", "paper-track", "contact")
HUMANS = {0.0: "careful", 1.0: "careless"}
BY_CONSTRUCTION = (
    "Where the human is careless, `none` is 0 by construction: castle 2 (in pocket_table cube 2) is then shown 1.5 to "
    "4 mm off, and the play of the fits is 0.25 mm."
)

Row = Mapping[str, Any]


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("folder", type=Path, help="the sweep of benchmarks/headline.toml")
    asked.add_argument("--full", type=Path, help="a sweep of the same grid at fidelity full")
    asked.add_argument("--trials", type=int, help="how many seeds to take")
    given = asked.parse_args()
    with tempfile.TemporaryDirectory() as copy:
        shorten(given.folder, Path(copy), given.trials)
        keep(Path(copy), given.full)


def shorten(folder: Path, copy: Path, trials: int | None) -> None:
    """Copy a sweep, or its first seeds."""
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    for grid in run["grids"]:
        grid["trials"] = trials or grid["trials"]
    end = run["grids"][0]["seed"] + run["grids"][0]["trials"]
    (copy / "run.json").write_text(json.dumps(run), encoding="utf-8")
    for name, lines in (("trials.jsonl", read_rows(folder)), ("timing.jsonl", read_timing(folder))):
        kept = (json.dumps(line) for line in lines if line["seed"] < end)
        (copy / name).write_text("".join(f"{line}\n" for line in kept), encoding="utf-8")


def keep(folder: Path, full: Path | None) -> None:
    rows = read_rows(folder)
    KEPT.mkdir(parents=True, exist_ok=True)
    shutil.copy(report(folder).tables["cells"], KEPT / "table.csv")
    cells = tally(rows)
    shown = [cell for cell in cells if cell.method in METHODS and cell.level > 0]
    draw(success_figure(shown)).write(FIGURE)
    ran = what_was_run(folder, rows)
    (KEPT / "run.json").write_text(json.dumps(ran, indent=2) + "\n", encoding="utf-8")
    lines = sorted(json.dumps({k: v for k, v in row.items() if k not in LEFT_OUT}) for row in rows)
    packed = lzma.compress("".join(f"{line}\n" for line in lines).encode(), preset=9 | lzma.PRESET_EXTREME)
    (KEPT / "rows.jsonl.xz").write_bytes(packed)
    agreement = [*lasting(folder, full), *agreed(full, folder)] if full else []
    told = page(cells, paired(rows, ("paper",)), ran, agreement)
    PAGE.write_text("\n".join(told) + "\n", encoding="utf-8")
    before, rest = README.read_text(encoding="utf-8").split(BEGIN)
    kept = "\n".join([BEGIN, "", *short(cells), "", END])
    README.write_text(before + kept + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote {KEPT}, {PAGE} and the table of {README}")


def what_was_run(folder: Path, rows: Sequence[Row]) -> dict[str, Any]:
    """Versions, grids, code and times; the command is the one that does it again."""
    run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    times = read_timing(folder)
    spent = {(t["scenario"], t["method"]): [] for t in times}
    for t in times:
        spent[t["scenario"], t["method"]].append(t["trial_s"])
    trials = run["grids"][0]["trials"]
    return {
        "command": f"make headline TRIALS={trials} FIDELITY={run['grids'][0]['fidelity']}",
        **{key: run[key] for key in ("schema", "grids", "versions", "python", "platform", "content", "code")},
        "rows": len(rows),
        "replays": sum(row["sim_seconds"] is not None for row in rows),
        "simulated_hours": round(sum(row["sim_seconds"] or 0.0 for row in rows) / 3600, 1),
        "worker_hours": round(sum(map(worked_s, times)) / 3600, 2),
        "workers": len({t["worker"] for t in times}),
        "median_trial_s": {f"{s}, {m}": round(middle.median(x), 3) for (s, m), x in sorted(spent.items())},
    }


def short(cells: Sequence[Cell]) -> list[str]:
    """The table of the README: success rates, a line per human, scenario and method; careful humans first."""
    shown = [cell for cell in cells if cell.method in METHODS]
    levels = sorted({cell.level for cell in shown})
    rates = {(c.careless, c.scenario, c.method, c.level): both(c) for c in shown}
    lines = ["| human | scenario | method | " + " | ".join(f"level {level:g}" for level in levels) + " |"]
    lines.append("|---|---|---|" + "---|" * len(levels))
    for careless in sorted({cell.careless for cell in shown}):
        for scenario in sorted({cell.scenario for cell in shown}):
            for method in METHODS:
                told = [rates.get((careless, scenario, method, level), "") for level in levels]
                lines.append(f"| {HUMANS[careless]} | {scenario} | `{method}` | {' | '.join(told)} |")
    said = "Careful humans first, careless ones below; in brackets what is also as demonstrated, where that is less."
    return [said, "", *lines, "", BY_CONSTRUCTION]


def both(cell: Cell) -> str:
    """Success in percent, and what is as demonstrated where that is less."""
    success, shown = (f"{100 * (rate or 0.0):.0f}" for rate in (cell.rate, cell.demonstrated_rate))
    return success if success == shown else f"{success} ({shown})"


def page(cells: Sequence[Cell], pairs: Sequence[Paired], ran: Mapping[str, Any], agreement: list[str]) -> list[str]:
    least = min(cell.trials + cell.excluded for cell in cells)
    fidelity, versions = ran["grids"][0]["fidelity"], ran["versions"]
    main_cells = [cell for cell in cells if cell.method in METHODS and cell.level > 0]
    rest = [cell for cell in cells if cell.level == 0.0]
    other = sorted({cell.method for cell in cells} - {*METHODS, "oracle"}, key=lambda m: (rank(m), m))
    return [
        "# The headline",
        "",
        f"Written by `python benchmarks/headline.py` from the rows of `{ran['command']}`: {ran['rows']} trials, "
        f"{ran['replays']} replays, at least {least} trials in each cell, fidelity `{fidelity}`; "
        f"{ran['simulated_hours']} hours simulated or passed over in {ran['worker_hours'] / ran['workers']:.2f} hours "
        f"by {ran['workers']} processes on a machine with two cores, which did other work now and then. MuJoCo "
        f"{versions['mujoco']}, mink {versions['mink']}, NumPy {versions['numpy']}, Python {ran['python']}; everything "
        "else in `benchmarks/results/headline/run.json`, rates with intervals in `table.csv`, rows (without the poses "
        "reached) in `rows.jsonl.xz` beside it.",
        "",
        "Success with a friction grasp and 0.25 mm clearance per side, Wilson's 95 % intervals: the finished assembly "
        "is right ([the two verdicts](../how/judge.md)). A level of L is a standard deviation of L mm and L degrees "
        "per axis; a careful human puts parts where they belong, a careless one adjusts them later, as in the paper. "
        "The same seeds for every method. `search` replays what was seen, as `none` does, with a robot that feels for "
        "the hole where an insertion is stopped.",
        "",
        f"{BY_CONSTRUCTION} What stands wrong to each other before anything is inserted cannot be searched away.",
        "",
        "![Success over level](../pictures/headline.png)",
        "",
        *table(main_cells, METHODS, counted),
        "",
        "## As demonstrated",
        "",
        "The stricter verdict on the same trials: every contact also when it was made, and where it was shown.",
        "",
        *table(main_cells, METHODS, demonstrated),
        "",
        "## Pairs",
        "",
        *differing(pairs),
        "",
        "## Without noise, and without any error",
        "",
        *table(rest, ("oracle", *METHODS), counted),
        "",
        "`oracle` replays the drawn layout and meets neither noise nor carelessness.",
        "",
        "## Baselines at level 2, careless humans",
        "",
        *table([cell for cell in cells if cell.method in other], other, counted),
        "",
        "The same trials as demonstrated:",
        "",
        *table([cell for cell in cells if cell.method in other], other, demonstrated),
        *agreement,
    ]


def table(cells: Sequence[Cell], methods: Sequence[str], say: Callable[[Cell], str]) -> list[str]:
    """One line per human, scenario and level, careful humans first; one column per method."""
    found: dict[tuple[float, str, float], dict[str, Cell]] = {}
    for cell in cells:
        found.setdefault((cell.careless, cell.scenario, cell.level), {})[cell.method] = cell
    return [
        "| human | scenario | level | " + " | ".join(f"`{m}`" for m in methods) + " |",
        "|---|---|---|" + "---|" * len(methods),
        *(
            f"| {HUMANS[careless]} | {scenario} | {level:g} | "
            + " | ".join(say(by_method[m]) if m in by_method else "" for m in methods)
            + " |"
            for (careless, scenario, level), by_method in sorted(found.items())
        ),
    ]


def counted(cell: Cell) -> str:
    """Successes, with their interval."""
    return share(cell.successes, cell)


def demonstrated(cell: Cell) -> str:
    """What is as demonstrated, with its interval."""
    return share(cell.demonstrated, cell)


def share(right: int, cell: Cell) -> str:
    low, high = wilson(right, cell.trials)
    return f"{right} of {cell.trials} ({100 * low:.0f} to {100 * high:.0f} %)"


def differing(pairs: Sequence[Paired]) -> list[str]:
    """Cells in which `contact` or `paper-track` ends otherwise than `paper` at any seed."""
    asked = [p for p in pairs if p.place.method in METHODS and not as_seen(p.place.method)]
    apart = [p for p in asked if p.only_method or p.only_reference]
    lines = [
        "`paper-track` and `contact` against `paper` over the same seeds, in the "
        f"{len(apart)} of {len(asked)} cells in which they do not end alike at every seed: at how many one alone was "
        "right, difference of the rates in points with Tango's 95 % interval, and McNemar's exact p, as it is and "
        "adjusted for all comparisons with `paper` (Holm).",
        "",
        "| scenario | careless | level | method | pairs | it alone | `paper` alone | difference | p | p adjusted |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for p in apart:
        at, (low, high) = p.place, (100 * x for x in p.interval)
        lines.append(
            f"| {at.scenario} | {at.careless:g} | {at.level:g} | `{at.method}` | {p.pairs} | {p.only_method} "
            f"| {p.only_reference} | {100 * p.difference:+.1f} ({low:+.1f} to {high:+.1f}) "
            f"| {p.p:.2g} | {p.p_adjusted:.2g} |"
        )
    return lines


def lasting(contact: Path, full: Path) -> list[str]:
    """How long 40 seeds take: counted, where there are as many, else in proportion."""
    lines = [
        "",
        "## How long it takes",
        "",
        "Work of all processes, shared evenly among two: what a sweep of 40 seeds takes on two cores.",
        "",
        "| fidelity | seeds | trials | minutes | 40 seeds |",
        "|---|---|---|---|---|",
    ]
    for name, folder in (("contact", contact), ("full", full)):
        times = read_timing(folder)
        first = min(t["seed"] for t in times)
        some = [t for t in times if t["seed"] < first + 40]
        seeds, minutes = len({t["seed"] for t in some}), sum(map(worked_s, some)) / 2 / 60
        lines.append(f"| {name} | {seeds} | {len(some)} | {minutes:.1f} | {minutes * 40 / seeds:.0f} min |")
    return lines


def worked_s(timing: Row) -> float:
    return sum(timing[part] or 0.0 for part in ("trial_s", "demonstrate_s", "compile_s"))


def agreed(full: Path, contact: Path) -> list[str]:
    """How far verdicts at fidelity contact are those at fidelity full."""
    found = compare(full, contact)
    lines = [
        "",
        "## Fidelity",
        "",
        "The same trials at fidelity `full`, in which every step of every motion is simulated: how many have the same "
        "verdict, and how many the same verdict, stage and code; Wilson's 95 % interval of the first. Trials of "
        "one seed share their random numbers; the last column counts the seeds with the same verdict in all trials.",
        "",
        "| scenario | trials | same verdict | interval | same ending | right at `full` alone | at `contact` alone "
        "| seeds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for a in found.agreements:
        low, high = a.same.interval
        lines.append(
            f"| {a.scenario} | {a.same.trials} | {a.same.successes} ({100 * (a.same.rate or 0):.1f} %) "
            f"| {100 * low:.1f} to {100 * high:.1f} % | {a.same_ending.successes} | {a.only_first} | {a.only_second} "
            f"| {a.same_everywhere.successes} of {a.same_everywhere.trials} |"
        )
    return lines


if __name__ == "__main__":
    main()
