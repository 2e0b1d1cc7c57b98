"""What a thousand generated assemblies are worth: `python -m benchmarks.thousand FOLDER`.

    python -m benchmarks.thousand FOLDER --check 1000            # without simulation: load, ways, correction; an hour
    python -m benchmarks.thousand FOLDER --simulate 100          # trials of 100, stratified by family and size
    python -m benchmarks.thousand FOLDER --simulate 24 --oracle 1 --others 0
    python -m benchmarks.thousand FOLDER --page                  # only write what is there

It takes hours, and goes on where it was stopped: a line is appended as soon as it is known. Several may run in folders
below FOLDER, with `--part 1/2`. At the end results/thousand_checks.csv, results/thousand_trials.csv and the tables of
docs/results/thousand.md are written.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import imageio.v3 as imageio
import numpy as np

from apo_bench.assembly import Demonstration, placements
from apo_bench.correction.correctors import correct
from apo_bench.errors import InputError
from apo_bench.generated import FAMILIES, drawn, whole_name
from apo_bench.io import grouped
from apo_bench.observation.looking import observe
from apo_bench.records import TrialSettings
from apo_bench.scenario import draw_layout, load_scenario, nominal_operations
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.scene.render import camera_view, picture
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.statistics import wilson
from apo_bench.trial.outcome_columns import goal_errors
from apo_bench.trial.stages import simulate_demonstration
from apo_bench.trial.trial import run_trial

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "results" / "thousand.md"
PICTURE = ROOT / "docs" / "pictures" / "thousand.png"
DRAWN = tuple(
    f"generated:{name}"
    for name in (
        *("corners:3", "posts:5", "covers:5", "carried:5"),
        *("pinned:4", "bridges:0", "grooves:5", "castles:0"),
    )
)
FIRST = "<!-- thousand -->"
LAST = "<!-- end of thousand -->"
CHECKS = ("name", "parts", "operations", "contacts", "wrong", "fixed_mm", "seen_mm", "gap_mm", "cpu_s")
TRIALS = ("name", "parts", "method", "seed", "success", "stage", "code", "operation", "sentence", "cpu_s")
METHODS = ("oracle", "contact", "none", "snap", "by-heart")
SEEDS = {"contact": 5, "none": 5, "snap": 2, "by-heart": 2}
"""Of each method but `oracle`."""
_NOISE_STREAM = 77

Line = Mapping[str, str]


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path)
    asked.add_argument("--check", type=int, default=0, help="so many are looked at without simulation")
    asked.add_argument("--simulate", type=int, default=0, help="so many are simulated")
    asked.add_argument("--oracle", type=int, default=5, help="seeds of `oracle`")
    asked.add_argument(
        "--others", type=float, default=1.0, help="which part of the seeds of the other methods, rounded up"
    )
    asked.add_argument("--part", default="1/1", help="only this part of the work: 1/2, 2/2")
    asked.add_argument("--page", action="store_true", help="write tables of what is there")
    given = asked.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    part, parts = map(int, given.part.split("/"))
    names = checked_names(given.check)[part - 1 :: parts]
    append(given.folder / "checks.csv", CHECKS, "name", names, lambda name: [check(name)])
    seeds = {"oracle": given.oracle} | {method: math.ceil(given.others * n) for method, n in SEEDS.items()}
    chosen = stratified(given.simulate)[part - 1 :: parts]
    trials(given.folder / "trials.csv", chosen, seeds)
    if given.page:
        keep(given.folder)
        draw()


def checked_names(count: int) -> list[str]:
    """As many as are asked for: nine of ten as a plain seed draws them, one of ten out of what is held out."""
    held_out = [family for family, each in FAMILIES.items() if not each.weight]
    drawn = [whole_name(f"generated:{seed}") for seed in range(count - count // 10)]
    return drawn + [f"generated:{held_out[k % len(held_out)]}:{k}" for k in range(count // 10)]


def stratified(count: int) -> list[str]:
    """So many, of all families in turn; those of a family are spread evenly over its sizes."""
    each = -(-count // len(FAMILIES))
    chosen = list[list[str]]()
    for family in FAMILIES:
        names = [f"generated:{family}:{seed}" for seed in range(3 * each)]
        by_size = sorted(names, key=lambda name: len(drawn(name).parts))
        chosen.append([by_size[round(k)] for k in np.linspace(0, len(names) - 1, each)])
    return [names[k] for k in range(each) for names in chosen][:count]


def append(
    path: Path, columns: Sequence[str], key: str, work: Iterable[str], look: Callable[[str], list[Line]]
) -> None:
    """Look at what has no line yet, and append its lines at once."""
    known = {line[key] for line in lines_of(path)}
    for each in work:
        if each not in known:
            write(path, columns, look(each))


def lines_of(path: Path) -> list[Line]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, columns: Sequence[str], lines: Iterable[Line]) -> None:
    is_new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        if is_new:
            writer.writeheader()
        for line in lines:
            writer.writerow(line)
            print(*line.values(), flush=True)


def check(name: str) -> Line:
    """What can be said of one without simulation: the loader's checks, free ways, a correction of 1 mm and 1 degree."""
    began = time.process_time()
    try:
        scenario = load_scenario(name)
    except (InputError, RuntimeError) as error:
        return line_of(CHECKS, name, *[""] * 3, str(error), *[""] * 3, time.process_time() - began)
    assembly = scenario.assembly
    wrong = [
        f"no free way in operation {k}" for k, each in enumerate(nominal_operations(scenario), 1) if not each.after.free
    ]
    rng = np.random.default_rng([_NOISE_STREAM, int(name.split(":")[-1])])
    layout = draw_layout(scenario, rng)
    final = placements(assembly, layout.start, layout.goals)[-1]
    shown = Demonstration(
        assembly=assembly,
        start=layout.start,
        goals=layout.goals,
        final=final,
        careless=np.zeros((len(assembly), 6, 6)),
        gap_m=1e-3 * scenario.gap_mm,
        play_m=1e-3 * scenario.clearance_mm,
    )
    seen = observe(shown, "isotropic", rng)
    correction = correct(seen, "contact")
    if correction.status != "converged":
        wrong.append(f"{correction.status}: {correction.sentence}")
    fixed, _ = goal_errors(assembly, layout.start, layout.goals, correction.goals)
    before, _ = goal_errors(assembly, layout.start, layout.goals, seen.goals)
    gap = 1e3 * float(correction.gap_after_m)
    contacts = sum(len(operation.contacts) for operation in assembly.operations)
    sizes = len(assembly.solids) - 1, len(assembly), contacts
    return line_of(CHECKS, name, *sizes, "; ".join(wrong), fixed, before, gap, time.process_time() - began)


def line_of(columns: Sequence[str], *cells: object) -> Line:
    texts = (f"{cell:.3g}" if isinstance(cell, float) else "" if cell is None else str(cell) for cell in cells)
    return dict(zip(columns, texts, strict=True))


def trials(path: Path, names: Sequence[str], seeds: Mapping[str, int]) -> None:
    """Trials at 1 mm and 1 degree, seed by seed, of what has no line yet; fidelity `contact`."""
    known = {(line["name"], line["method"], line["seed"]) for line in lines_of(path)}
    for name in names:
        wanted = [(s, m) for s in range(max(seeds.values())) for m in METHODS if s < seeds[m]]
        left = [(seed, method) for seed, method in wanted if (name, method, str(seed)) not in known]
        if not left:
            continue
        scene = build_scene(load_scenario(name))
        parts = len(scene.scenario.assembly.solids) - 1
        for seed in sorted({seed for seed, _ in left}):
            simulated = simulate_demonstration(scene, 1.0, seed)
            cache = ReplayCache()
            for method in (method for s, method in left if s == seed):
                began = time.process_time()
                settings = TrialSettings(name, method=method, seed=seed, fidelity="contact")
                row = run_trial(settings, scene, simulated=simulated, cache=cache)
                said = row["failure_stage"], row["failure_code"], row["failure_operation"], row["sentence"]
                success = None if row["success"] is None else int(row["success"])
                cells = name, parts, method, seed, success, *said, time.process_time() - began
                write(path, TRIALS, [line_of(TRIALS, *cells)])


def keep(folder: Path) -> None:
    """Write the lines in order, and the tables into the page."""
    kept = []
    for kind, columns in (("checks", CHECKS), ("trials", TRIALS)):
        lines = [line for path in sorted(folder.glob(f"**/{kind}.csv")) for line in lines_of(path)]
        kept.append(lines)
        target = RESULTS / f"thousand_{kind}.csv"
        target.unlink(missing_ok=True)
        with target.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(lines)
    before, rest = PAGE.read_text(encoding="utf-8").split(FIRST)
    text = "\n".join([*checks_table(kept[0]), "", *trials_table(kept[1])])
    PAGE.write_text(f"{before}{FIRST}\n\n{text}\n\n{LAST}{rest.split(LAST)[1]}", encoding="utf-8")
    print(f"Wrote {PAGE}")


def draw() -> None:
    """One assembly of each of eight families, every part at its goal, in two rows."""
    views = []
    for name in DRAWN:
        scene = build_scene(load_scenario(name))
        scenario = scene.scenario
        poses = placements(scenario.assembly, scenario.start, scenario.goals)[-1]
        view = camera_view((0.0, 0.0, 0.04), 0.33, 150.0, -30.0)
        views.append(picture(scene, poses, 360, 300, view))
    rows = [np.concatenate(views[k : k + 4], axis=1) for k in (0, 4)]
    imageio.imwrite(PICTURE, np.concatenate(rows, axis=0))


def checks_table(lines: Sequence[Line]) -> Iterator[str]:
    yield "| family | looked at | parts | contacts | wrong | error of fixed directions seen, corrected | largest gap |"
    yield "|---|---|---|---|---|---|---|"
    for family in (*FAMILIES, ""):
        own = [line for line in lines if line["name"].startswith(f"generated:{family}")]
        good = [line for line in own if line["fixed_mm"]]
        if not good:
            continue
        parts = [int(line["parts"]) for line in good]
        contacts = [int(line["contacts"]) for line in good]
        seen, fixed = (np.median([float(line[key]) for line in good]) for key in ("seen_mm", "fixed_mm"))
        gap = max(float(line["gap_mm"]) for line in good)
        wrong = sum(bool(line["wrong"]) for line in own)
        yield (
            f"| {family or 'all'} | {len(own)} | {min(parts)} to {max(parts)} | {min(contacts)} to {max(contacts)} | "
            f"{wrong} | {seen:.2f}, {fixed:.2f} mm | {gap:.2g} mm |"
        )
    yield from ("", "*Error*: root mean square per operation, the median over assemblies.")
    wrong = [line for line in lines if line["wrong"]]
    yield from ("", *(f"- `{line['name']}`: {line['wrong']}" for line in wrong[:20]))


def trials_table(lines: Sequence[Line]) -> Iterator[str]:
    methods = [method for method in METHODS if any(line["method"] == method for line in lines)]
    yield f"| family | assemblies | {' | '.join(f'`{method}`' for method in methods)} |"
    yield f"|---|---|{'---|' * len(methods)}"
    for family in (*FAMILIES, ""):
        own = [line for line in lines if line["name"].startswith(f"generated:{family}")]
        if own:
            names = len({line["name"] for line in own})
            cells = [rate([line for line in own if line["method"] == method]) for method in methods]
            yield f"| {family or 'all'} | {names} | {' | '.join(cells)} |"
    for method in ("oracle", "contact"):
        ended = grouped((line["name"], line["success"] == "1") for line in lines if line["method"] == method)
        whole = [all(each) for each in ended.values() if len(each) == SEEDS["contact"]]
        yield from ("", f"All five trials of `{method}` are right in {sum(whole)} of {len(whole)} assemblies.")
    bad = [line for line in lines if line["success"] != "1" and line["method"] in ("oracle", "contact")]
    yield from ("", "Trials of `oracle` and `contact` that fail:", "") if bad else ()
    yield from (f"- `{x['name']}`, `{x['method']}`, seed {x['seed']}: {x['code']}, {x['sentence']}" for x in bad)


def rate(lines: Sequence[Line]) -> str:
    """Successes of those that count, with Wilson's 95 % interval."""
    counted = [line["success"] == "1" for line in lines if line["success"]]
    if not counted:
        return ""
    low, high = wilson(sum(counted), len(counted))
    return f"{sum(counted)} of {len(counted)} ({100 * low:.0f} to {100 * high:.0f} %)"


if __name__ == "__main__":
    main()
