"""The old rule of `success` against the new one, on the same replays: `python benchmarks/verdicts.py FOLDER`.

Reads the rows of a sweep that was made with the new rule, and says of each what the rule before it would have said:
then no corner of a part was to be more than `pushed_mm` from where it was after its last operation, in the room, and a
face that fits could be apart by its own clearance and `fit_margin_mm` only. The first is in the rows (`pushed_mm`); the
second is measured anew where the parts ended (`reached`), at the contacts that may be farther apart today. Writes
docs/results/verdicts.md, cell by cell, with the reason of every trial whose verdict is another one (`--page`,
`--trials N` take another file and the first N seeds). Trials whose demonstration was refused have no verdict.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.assembly import Contact, Layout, joint_play_mm, placements
from apo_bench.geometry import Array, nearest_alike, pose
from apo_bench.geometry.covering import overlap
from apo_bench.judging.verdict import fixtures
from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.run_folder import read_rows
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.layout import draw_layout
from apo_bench.scenario.scenario import Scenario
from apo_bench.statistics import rank
from apo_bench.trial.stages import LAYOUT, stream
from benchmarks.made_with import mujoco_of, with_mujoco

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "results" / "verdicts.md"
CELL = ("scenario", "careless", "level", "method")

Row = Mapping[str, Any]


class Wide(NamedTuple):
    """A contact that may be farther apart than by the old rule."""

    contact: Contact
    old_mm: float
    new_mm: float


class Compared(NamedTuple):
    """A trial by both rules."""

    row: Row
    old: bool
    new: bool
    why: str
    """What makes the difference; empty where there is none."""


class Counts(NamedTuple):
    """Of a cell."""

    trials: int
    old: int
    new: int
    pushed: int
    """Trials that are right today although a part moved in the room."""
    gap: int
    """Trials that are right today although a face was farther apart than its own clearance."""
    refused: int
    """Trials that were right by the old rule and are not today."""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("folder", type=Path, help="a sweep, finished or not")
    asked.add_argument("--trials", type=int, help="how many seeds to take")
    asked.add_argument("--page", type=Path, default=PAGE)
    given = asked.parse_args()
    rows = sorted((row for row in read_rows(given.folder) if row["success"] is not None), key=place)
    if not rows:
        asked.error(f"no row of {given.folder} has a verdict; name the folder of a sweep")
    if given.trials is not None:
        rows = [row for row in rows if row["seed"] < rows[0]["seed"] + given.trials]
    written = "\n".join(page([compared(row) for row in rows])) + "\n"
    given.page.write_text(with_mujoco(written, mujoco_of([given.folder])), encoding="utf-8")
    print(f"Wrote {given.page}")


def place(row: Row) -> tuple[Any, ...]:
    return row["seed"], row["scenario"], row["careless"], row["level"], rank(row["method"]), row["method"]


def compared(row: Row) -> Compared:
    """What both rules say of a row, and why they differ."""
    conditions = dict(row["conditions"] or {"not_made": True})
    scenario = load_scenario(row["scenario"])
    limit = row["thresholds"]["pushed_mm"]
    moved = row["pushed_mm"] or 0.0
    # Where the way counts, both rules ask for the same displacement.
    pushed = conditions.get("pushed", False) if scenario.success_means == "as_demonstrated" else moved > limit
    wide = None if conditions.get("gap", True) else too_wide(scenario, row)
    before = conditions | {"pushed": pushed, "gap": conditions.get("gap", False) or wide is not None}
    old = not any(before.values())
    new = bool(row["success"])
    if old == new:
        return Compared(row, old, new, "")
    if old:
        return Compared(row, old, new, f"refused: {row['sentence']}")
    reasons = []
    if pushed:
        reasons.append(f"pushed: a corner moved by {moved:.2f} mm in the room, but nothing slid so on what it touches")
    if wide is not None:
        reasons.append(
            f"gap: {wide[0].contact} is off by {wide[1]:.2f} mm, {wide[0].old_mm:g} then, {wide[0].new_mm:.2f} today"
        )
    return Compared(row, old, new, "; ".join(reasons))


def too_wide(scenario: Scenario, row: Row) -> tuple[Wide, float] | None:
    """The contact that was the farthest too far apart at the end by the old rule, and its largest |e|, [mm]."""
    true_goals = truth(row["scenario"], row["seed"], row["salt"], row["clearance_mm"]).goals
    margin_mm = row["thresholds"]["fit_margin_mm"]
    wides = wide_contacts(row["scenario"], row["seed"], row["salt"], row["clearance_mm"], margin_mm)
    if not wides or row["reached"] is None:
        return None
    poses = {part: posed(numbers) for part, numbers in row["reached"].items()}
    assembly = scenario.assembly
    true = placements(assembly, poses, true_goals)[-1]
    seen = {
        part: T if part in assembly.fixed else nearest_alike(assembly.solids[part], T, true[part])
        for part, T in poses.items()
    }
    found = [(wide, off_mm(scenario, wide.contact, seen)) for wide in wides]
    over = [(wide, off) for wide, off in found if off > wide.old_mm]
    return max(over, key=lambda each: each[1] - each[0].old_mm, default=None)


@lru_cache(maxsize=4096)
def truth(scenario: str, seed: int, salt: Any, clearance_mm: float) -> Layout:
    """Where the parts of a seed start and belong."""
    return draw_layout(load_scenario(scenario), stream(seed, LAYOUT, salt), clearance_mm)


@lru_cache(maxsize=4096)
def wide_contacts(name: str, seed: int, salt: Any, clearance_mm: float, margin_mm: float) -> tuple[Wide, ...]:
    """The contacts that stand at the end and that the play of all faces together lets farther apart."""
    assembly = load_scenario(name).assembly
    layout = truth(name, seed, salt, clearance_mm)
    history = placements(assembly, layout.start, layout.goals)
    away = fixtures(assembly)
    found = []
    for contact, made, lost in assembly.relations():
        if lost is None and not away & {end.part for end in contact}:
            play = joint_play_mm(assembly, contact, made, history[made], clearance_mm)
            if play is not None and play > clearance_mm:
                found.append(Wide(contact, clearance_mm + margin_mm, play + margin_mm))
    return tuple(found)


def off_mm(scenario: Scenario, contact: Contact, poses: Mapping[str, Array]) -> float:
    """The largest distance of a corner of the overlap of two flat faces from the plane of the first, [mm]."""
    m, e = contact
    face = scenario.assembly.face(m)
    T = poses[m.part]
    corners = overlap(face, T, scenario.assembly.face(e), poses[e.part]).corners
    return 1e3 * float(np.abs((corners - T[:3, 3]) @ T[:3, :3] @ face.plane[:3] + face.plane[3]).max(initial=0.0))


def posed(numbers: Sequence[float]) -> Array:
    """The pose of a row: mm and a quaternion."""
    return pose.unpack([*(1e-3 * np.array(numbers[:3])), *numbers[3:]])


def cells(found: Iterable[Compared]) -> dict[tuple[Any, ...], Counts]:
    grouped: dict[tuple[Any, ...], list[Compared]] = {}
    for each in found:
        grouped.setdefault(tuple(each.row[name] for name in CELL), []).append(each)
    return {cell: counted(grouped[cell]) for cell in sorted(grouped, key=by_cell)}


def by_cell(cell: tuple[Any, ...]) -> tuple[Any, ...]:
    scenario, careless, level, method = cell
    return scenario, careless, level, rank(method), method


def counted(found: Sequence[Compared]) -> Counts:
    return Counts(
        trials=len(found),
        old=sum(each.old for each in found),
        new=sum(each.new for each in found),
        pushed=sum("pushed: " in each.why for each in found if each.new),
        gap=sum("gap: " in each.why for each in found if each.new),
        refused=sum(each.old and not each.new for each in found),
    )


def page(found: Sequence[Compared]) -> list[str]:
    every = cells(found)
    changed = [each for each in found if each.why]
    seeds = [each.row["seed"] for each in found]
    whole = counted(found)
    apart = {cell: n for cell, n in every.items() if n.pushed or n.gap or n.refused}
    return [
        "<!-- Written by `python benchmarks/verdicts.py FOLDER`; change that, not this page. -->",
        "",
        "# The old rule of success and the new one",
        "",
        "The same replays by two rules. By the old one no corner of a part was to move by more than 1 mm in the room "
        "after it was put, and a face that fits could be apart by its own clearance and 0.1 mm only. By the new one "
        "[what slid on what it touches](../how/judge.md#displacement) counts, and [the play of all faces]"
        "(../how/judge.md#play) is allowed. Nothing else differs.",
        "",
        f"Of {whole.trials} replays, seeds {min(seeds)} to {max(seeds)}, {whole.old} are right by the old rule and "
        f"{whole.new} by the new one; {len(changed)} verdicts differ: in {whole.pushed} something was nudged that kept "
        f"its place in the whole, in {whole.gap} a part lay within its play, and {whole.refused} are refused today.",
        "",
        f"## Cells in which they differ ({len(apart)} of {len(every)})",
        "",
        "| scenario | careless | level | method | n | old | new | nudged | in its play | refused |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *(
            f"| {scenario} | {careless:g} | {level:g} | `{method}` | {n.trials} | {n.old} | {n.new} "
            f"| {n.pushed} | {n.gap} | {n.refused} |"
            for (scenario, careless, level, method), n in apart.items()
        ),
        "",
        "In all other cells both rules count the same successes:",
        "",
        "| scenario | careless | level | right by both rules, of all |",
        "|---|---|---|---|",
        *same(every),
        "",
        f"## Each trial ({len(changed)})",
        "",
        *listed(changed),
    ]


def same(every: Mapping[tuple[Any, ...], Counts]) -> list[str]:
    """One line per scenario, carelessness and level: each method whose cell is the same."""
    lines: dict[tuple[Any, ...], list[str]] = {}
    for (*where, method), n in every.items():
        if not (n.pushed or n.gap or n.refused):
            lines.setdefault(tuple(where), []).append(f"`{method}` {n.new} of {n.trials}")
    return [f"| {s} | {c:g} | {level:g} | {', '.join(told)} |" for (s, c, level), told in lines.items()]


def listed(changed: Sequence[Compared]) -> list[str]:
    if not changed:
        return ["None."]
    lines = [
        f"| `{replay_command(each.row).removeprefix('apo-bench replay ')}` | {each.why} |"
        for each in sorted(
            changed, key=lambda each: (by_cell(tuple(each.row[name] for name in CELL)), each.row["seed"])
        )
    ]
    return ["| `apo-bench replay` .. | why |", "|---|---|", *lines]


if __name__ == "__main__":
    main()
