"""Constructed end states: an assembly as it should be, but for some edits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from apo_bench import Criteria, Verdict, judge
from apo_bench.assembly import ReachedState, Snapshot, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.judgement import Judgement
from apo_bench.records import Thresholds
from tests import scenes

CLEARANCE_MM = 0.25
LAYOUT = pose.at((0.1, 0.02, 0.0), (0.0, 0.0, 17.0))
END = -1
FIELDS = {"penetration_m": 0.0, "speed_m_s": 0.0, "spin_rad_s": 0.0, "released": True}
"""What a snapshot says besides the poses, when nothing is wrong."""

Edit = Callable[[list[dict]], None]
"""Changes the states after each operation and at the end: a list of {part: pose, field of Snapshot: value} or None."""


def shift(part: str, since: int, *mm_and_turn: object, until: int | None = None) -> Edit:
    """The part lies elsewhere from the end of that operation on (from 1; END: at the end only), in its own frame."""

    def edit(states: list[dict]) -> None:
        first = len(states) - 1 if since == END else since - 1
        for state in states[first : until if until is None else until - 1]:
            state[part] = state[part] @ scenes.mm(*mm_and_turn)

    return edit


def put(part: str, since: int, T: Array) -> Edit:
    """The part stands there, in the frame of the assembly, from the end of that operation on."""

    def edit(states: list[dict]) -> None:
        for state in states[since - 1 :]:
            state[part] = LAYOUT @ T

    return edit


def moved(since: int, T: Array, *parts: str, until: int | None = None) -> Edit:
    """Parts, by default all that are loose, move together by T in the frame of the assembly, from that operation on."""
    carried = LAYOUT @ T @ pose.inverse(LAYOUT)

    def edit(states: list[dict]) -> None:
        first = len(states) - 1 if since == END else since - 1
        for state in states[first : until if until is None else until - 1]:
            for part in parts or [name for name in state if name not in FIELDS and name != "table"]:
                state[part] = carried @ state[part]

    return edit


def state(when: int, **fields: object) -> Edit:
    """Fields of the snapshot after that operation, END for the last one."""

    def edit(states: list[dict]) -> None:
        states[when if when == END else when - 1].update(fields)

    return edit


def never(*moments: int) -> Edit:
    """There is no snapshot of these moments."""

    def edit(states: list[dict]) -> None:
        for when in moments:
            states[when if when == END else when - 1].clear()

    return edit


def reached(scene: scenes.Scene, edits: Sequence[Edit]) -> list[dict]:
    """After each operation and at the end: everything as it should be but for the edits."""
    there = scenes.turned(scene, LAYOUT)
    history = compute_placements(there.assembly, there.start, there.nominal_poses)
    states: list[dict] = [dict(poses) for poses in (*history, history[-1])]
    for edit in edits:
        edit(states)
    return states


def verdict(scene: scenes.Scene, edits: Sequence[Edit], thresholds: Thresholds = Thresholds()) -> Verdict:  # noqa: B008
    """The judge's answer to that."""
    there = scenes.turned(scene, LAYOUT)
    snapshots = [snapshot(state) if state else None for state in reached(scene, edits)]
    return judge(
        there.assembly,
        ReachedState(tuple(snapshots[:-1]), snapshots[-1]),
        there.nominal_poses,
        Criteria(thresholds, CLEARANCE_MM),
    )


def shown(scene: scenes.Scene, edits: Sequence[Edit], thresholds: Thresholds = Thresholds()) -> Judgement:  # noqa: B008
    """What the rule of every moment finds: whether it was made as demonstrated."""
    return verdict(scene, edits, thresholds).demonstrated


def snapshot(state: Mapping) -> Snapshot:
    poses = {name: value for name, value in state.items() if name not in FIELDS}
    return Snapshot(poses, **{name: state.get(name, value) for name, value in FIELDS.items()})


TOWER = scenes.stick_in_tower
CASTLES = scenes.stick_on_castles
FIXTURE = scenes.fixture
ALIGNED = scenes.fixture_alignment
CARRIED = scenes.subassembly_on_castles
POCKETS = scenes.pockets
BRIDGE = scenes.bridge
