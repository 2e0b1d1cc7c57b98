"""Write the audit of the judge into docs/results/audit.md, below its head, and draw its doubtful states (a minute)."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import imageio.v3 as imageio
import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import fixtures
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.render import SceneCamera, camera_view, picture
from apo_bench.simulation.scene.scene import build_scene
from tests import audited_more_rounds as more
from tests import audited_rounds as rounds
from tests import audited_states as audited
from tests import audited_wholes as wholes
from tests.end_states import reached, verdict
from tests.judging import test_verdict as first

HERE = Path(__file__).parent
PAGE = HERE / "results" / "audit.md"
BEGIN = "<!-- written by docs/verdict.py -->"
WIDTH = 480
HEIGHT = 320
QUALITY = 80
NEAREST_M = 0.28
AZIMUTH_DEG = -75.0
ELEVATION_DEG = -28.0
DOUBTFUL = {
    "bridge, A lies along the seam, turned by 80 degrees": "bridge_cycle",
    "bridge, turned by 60 degrees": "bridge_cycle",
    "bridge, B and C in each other's place": "bridge_cycle",
    "pockets, the cubes in each other's pocket": "pocket_table",
    "pockets, cube 1 on top of cube 3": "pocket_table",
    "fixture, the cube put down on the finished assembly": "vanished_fixture",
    "fixture, the cube was not put away: it stands against castle 2": "vanished_fixture",
}
"""States that are drawn, each with the scenario whose parts it is of."""
GROUPS = {
    "Parts that are turned": audited.TURNED,
    "At another place": audited.ELSEWHERE,
    "After it was built": audited.AFTERWARDS,
    "On the way": audited.ON_THE_WAY,
    "At the thresholds": audited.MARGINS,
    "Fixtures": audited.FIXTURES,
    "Pegs that stand in holes": rounds.PEGS,
    "Shafts that lie, and shafts through two parts": rounds.SHAFTS,
    "Cones": rounds.CONES,
    "Tilted faces": rounds.TILTED,
    "Wholes that were moved": wholes.WHOLES,
    "Halves that were moved": wholes.HALVES,
    "Pegs, moved": more.PEGS,
    "Shafts, moved": more.SHAFTS,
    "Cones, moved": more.CONES,
    "Tilted faces, moved and in their play": more.TILTED,
}

FLIPS = """
## States whose verdict changed

Of the {n} states that the judge was audited with at first, these {flipped} were no success when every contact was asked
for as it was made, or when a part was not to move in the room, and are one now. All others keep their verdict.

| state | why it is right |
|---|---|
"""

REVISED = """
### Moved after they were put

Until a part could move in the room as long as it keeps its place in the whole, the person had said *wrong* of these
{n} states of the audit below, for where a part had been before, which nobody sees who sees the finished assembly. The
person now says *right*, and so does `success`. Of {more} others the person had said *right* from the beginning, and
`success` only says so now: {named}.

| state | why it is right |
|---|---|
"""
FOLLOWED = (
    "tower, all of it turned by 0.6 degrees at the end",
    "tower, the stick turned by 0.6 degrees at the end",
    "stop for two: B pushed by 3 mm when D goes",
)
"""States that were a difference between person and rule, and are none."""

AUDIT = """
## The audit

{n} states more, of all examples of the paper and of parts with round and tilted faces, were written down with the
verdict of a person who sees how they ended, before the judge was asked. In {same} the judge says the same. In the other
{apart} the rule says otherwise; the rule stays, and these are the reasons:

| state | person | `success` | what in the rule |
|---|---|---|---|
"""


def main() -> None:
    states = {seen.what: seen for group in (audited, rounds, wholes, more) for seen in group.STATES}
    cases = [*first.RIGHT, *first.NEARLY, *first.WRONG]
    apart = {**audited.DIFFERS, **rounds.DIFFERS, **wholes.DIFFERS, **more.DIFFERS}
    lines = [BEGIN, FLIPS.format(n=len(cases), flipped=len(first.FLIPPED)).rstrip("\n")]
    lines += [f"| {what} | {reason} |" for what, reason in first.FLIPPED.items()]
    revised = {**audited.REVISED, **rounds.REVISED}
    named = "; ".join(f"*{what}*" for what in FOLLOWED)
    lines.append(REVISED.format(n=len(revised), more=len(FOLLOWED), named=named).rstrip("\n"))
    lines += [f"| {what} | {reason} |" for what, reason in revised.items()]
    lines += [AUDIT.format(n=len(states), same=len(states) - len(apart), apart=len(apart)).rstrip("\n")]
    lines += [
        f"| {what} | {yes(states[what].right)} | {success(states[what])} | {why} |" for what, why in apart.items()
    ]
    lines += ["", "Some that are open to doubt:", ""]
    for what, scenario in DOUBTFUL.items():
        name = f"../pictures/verdict_{list(DOUBTFUL).index(what) + 1}.jpg"
        draw(states[what], scenario, PAGE.parent / name)
        said = f"{what}: a person says {yes(states[what].right)}, `success` says {success(states[what])}."
        lines += [f"![{what}]({name})", "", said, ""]
    for title, group in GROUPS.items():
        lines += [f"### {title}", "", *table(group), ""]
    lines += ["### The states of before", "", *table(cases)]
    head = PAGE.read_text(encoding="utf-8").split(BEGIN)[0]
    PAGE.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")


def table(states: Iterable[audited.Seen | first.Case]) -> list[str]:
    lines = ["| state | person | `success` | `as_demonstrated` |", "|---|---|---|---|"]
    for state in states:
        found = verdict(state.scene(), state.edits)
        right = state.right if isinstance(state, audited.Seen) else (state.code == "ok" or state.what in first.FLIPPED)
        strict = found.finished if found.demonstrated.holds else found.demonstrated
        shown = "yes" if found.as_demonstrated else f"no: {strict.code}"
        lines.append(f"| {state.what} | {yes(right)} | {success(state)} | {shown} |")
    return lines


def yes(right: bool) -> str:
    return "right" if right else "wrong"


def success(state: audited.Seen | first.Case) -> str:
    found = verdict(state.scene(), state.edits)
    return "yes" if found.success else f"no: {found.finished.code}"


def draw(state: audited.Seen, scenario: str, path: Path) -> None:
    """How it ended, in the frame of its table."""
    scene = build_scene(load_scenario(scenario))
    end = reached(state.scene(), state.edits)[-1]
    poses = {part: pose.inverse(end["table"]) @ T for part, T in end.items() if part in scene.scenario.start}
    image = picture(scene, poses, WIDTH, HEIGHT, camera(poses, fixtures(scene.scenario.assembly)))
    imageio.imwrite(path, image, extension=".jpg", quality=QUALITY)


def camera(poses: Mapping[str, Array], away: Collection[str]) -> SceneCamera:
    """One that sees all but the table and what was put away."""
    at = np.array([T[:3, 3] for part, T in poses.items() if part not in ("table", *away)])
    low = at.min(axis=0)
    high = at.max(axis=0)
    return camera_view(
        (low + high) / 2, NEAREST_M + 0.9 * float(np.linalg.norm(high - low)), AZIMUTH_DEG, ELEVATION_DEG
    )


if __name__ == "__main__":
    main()
