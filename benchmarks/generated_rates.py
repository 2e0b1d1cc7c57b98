"""Run ten assemblies of random dimensions without manual work: `python benchmarks/generated_rates.py FOLDER`.

Writes part files, poses and a scenario of each assembly, checks it, and runs trials at 1 mm and 1 degree, seed after
seed. FOLDER/rows.csv keeps the trials, and a second run continues there. Writes results/generated.csv and the tables of
docs/results/generated.md.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import Rate
from apo_bench.importers.assembly.scenario_check import check_file
from apo_bench.records import TrialConfig
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.run import run_trial
from apo_bench.trial.trial_stages import scene_of, simulate_demonstration
from benchmarks.generated import FAMILIES, generated, scenario_of
from benchmarks.rates_by_condition import counted

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "generated.csv"
PAGE = ROOT / "docs" / "results" / "generated.md"
FIRST = "<!-- rates -->"
LAST = "<!-- end of rates -->"
COLUMNS = ("assembly", "method", "seed", "success", "stage", "code", "operation", "sentence")
CHECK = "check"  # in place of a method: `scenario check` without its trials
FEW = 5  # seeds of all methods; `contact` has more
METHODS = ("oracle", "contact", "uncorrected", "snap", "snap+spiral", "nominal")
HEADS = {"oracle": "`oracle`"} | {method: f"`{method}` at 1 mm" for method in METHODS[1:]}

Line = Mapping[str, str]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--assemblies", type=int, default=10)
    parser.add_argument("--seeds", type=int, default=20)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    rows = given.folder / "rows.csv"
    if not rows.exists():
        rows.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    for line in run(given.folder, given.assemblies, given.seeds, read_lines(rows)):
        with rows.open("a", encoding="utf-8", newline="") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(line)
        print(*line.values(), flush=True)
    keep(read_lines(rows))


def run(folder: Path, assemblies: int, seeds: int, known: Sequence[Line]) -> Iterator[Line]:
    """Yield checks, then trials seed by seed, that are not known."""
    there = {(line["assembly"], line["method"], line["seed"]) for line in known}
    paths = {str(k): folder / f"generated_{k}" / f"generated_{k}.toml" for k in range(assemblies)}
    for name, path in paths.items():
        if not path.exists():
            scenario_of(int(name), path.parent)
        if (name, CHECK, "") not in there:
            yield check(name, path)
    scenes: dict[str, Scene] = {}
    for seed in range(seeds):
        for name, path in paths.items():
            methods = METHODS if seed < FEW else ("contact",)
            missing = [method for method in methods if (name, method, str(seed)) not in there]
            asked = [TrialConfig(str(path), method=method, seed=seed) for method in missing]
            if not asked:
                continue
            scenes[name] = scenes.get(name) or scene_of(asked[0])
            simulated = simulate_demonstration(scenes[name], asked[0].human_error_scale, seed)
            cache = ReplayCache()
            for settings in asked:
                row = run_trial(settings, scenes[name], simulated=simulated, cache=cache)
                said = row["failure_stage"], row["failure_code"], row["failure_operation"], row["sentence"]
                success = "" if row["success"] is None else int(row["success"])
                cells = (name, settings.method, seed, success, *said)
                yield dict(zip(COLUMNS, ("" if cell is None else str(cell) for cell in cells), strict=True))


def check(name: str, path: Path) -> Line:
    """Return what `scenario check` finds before any trial, or the size of a right scenario."""
    found = tuple(check_file(path, seeds=0))
    wrong = [each.sentence for each in found if not each.ok]
    cells = (name, CHECK, "", str(int(not wrong)), "", "", "", "; ".join(wrong) or found[0].sentence)
    return dict(zip(COLUMNS, cells, strict=True))


def read_lines(path: Path) -> list[Line]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def keep(lines: Sequence[Line]) -> None:
    """Write the trials of seeds that every assembly has, in order, and the tables of the page."""
    order = (CHECK, *METHODS)
    names = {line["assembly"] for line in lines}
    seen = Counter((line["method"], line["seed"]) for line in lines)
    lines = [line for line in lines if seen[line["method"], line["seed"]] == len(names)]
    lines = sorted(lines, key=lambda x: (int(x["assembly"]), order.index(x["method"]), int(x["seed"] or 0)))
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)
    before, rest = PAGE.read_text(encoding="utf-8").split(FIRST)
    PAGE.write_text(f"{before}{FIRST}\n\n{tables(lines)}\n\n{LAST}{rest.split(LAST)[1]}", encoding="utf-8")
    print(f"Wrote {KEPT} and {PAGE}")


def tables(lines: Sequence[Line]) -> str:
    methods = [method for method in METHODS if any(line["method"] == method for line in lines)]
    made = [
        f"| assembly | kind | parts | contacts | checked | {' | '.join(HEADS[m] for m in methods)} |",
        f"|---|---|---|---|---|{'---|' * len(methods)}",
    ]
    for name in dict.fromkeys(line["assembly"] for line in lines):
        own = [line for line in lines if line["assembly"] == name]
        made.append(f"| {name} | {' | '.join(_cells(int(name), own, methods))} |")
    every = " | ".join(rate(lines, method) for method in methods)
    made += [
        f"| all | | | | {rate(lines, CHECK)} | {every} |",
        "",
        "Trials of `oracle` and `contact` that fail:",
        "",
    ]
    wrong = [line for line in lines if line["method"] in METHODS[:2] and line["success"] != "1"]
    made += [f"- {x['assembly']}, `{x['method']}`, seed {x['seed']}: {x['code']}, {x['sentence']}." for x in wrong]
    return "\n".join(made if wrong else made[:-3])


def _cells(assembly: int, own: Sequence[Line], methods: Sequence[str]) -> Iterator[str]:
    yield FAMILIES[assembly % len(FAMILIES)].__name__
    yield str(len(generated(assembly).places))
    check = next(line for line in own if line["method"] == CHECK)
    contacts = re.search(r"\((.*)\)", check["sentence"])
    yield contacts[1] if check["success"] == "1" and contacts else ""
    yield "yes" if check["success"] == "1" else check["sentence"]
    yield from (rate(own, method) for method in methods)


def rate(lines: Sequence[Line], method: str) -> str:
    """Return the successes of the trials that count, with Wilson's 95 % interval."""
    ends = [line["success"] == "1" for line in lines if line["method"] == method and line["success"]]
    return counted(Rate(sum(ends), len(ends)))


if __name__ == "__main__":
    main()
