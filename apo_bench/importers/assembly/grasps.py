"""Find a grasp from above for each part of a new scenario, with the collision checks of the robot's planner."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import PAD_M, Array, PadPlace, Solid, find_holds, measure_extent, pose
from apo_bench.importers.assembly.order_search import Placement
from apo_bench.importers.assembly.posed_parts import TABLE
from apo_bench.planning.insertion.arrival import plan_arrival
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.planning.insertion.macros import UP
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import RestingPart, Stroke, find_clear_grasp, list_obstacles, plan_arrival_line

_ARM = "six_axis"  # the grasps are checked for this arm
_OVER_M = (0.0, 0.005, 0.0085)
"""Heights of the fingertips over the top of a part, tried in this order. The last two suit parts that protrude little:
the pads then hold their uppermost 5 or 1.5 mm.
"""
_MOST_HOLDS = 40
"""The largest number of places that are tried at each height."""
_GRAZE_M = 0.0015
"""A pad that reaches by less than this over a piece touches its edge only."""
_SAME_M = 1e-6  # lengths with a smaller difference are equal
_LIFT_M = 0.03  # the straight lift from the start that must be free


class GraspSearchResult(NamedTuple):
    """The grasps of all moved parts."""

    grasps: Mapping[str, Grasp | None]  # None: no place can be held from above
    crowded: frozenset[str]
    """Parts with places to hold, none of which has room for the gripper; their grasp is the best place nevertheless."""


def find_grasps(
    solids: Mapping[str, Solid],
    poses: Poses,
    starts: Poses,
    fixtures: Mapping[str, Solid],
    order: Sequence[Placement],
    base: Sequence[str],
) -> GraspSearchResult:
    """Return the best grasp of each moved part that is free at its start, at its goal and along its insertion path.

    Args:
        poses: Final pose of every part, world, [m].
        starts: Start pose of every part and fixture, world, [m].
        fixtures: Part -> the fixture that carries it at its start.
        order: The operations in their order.
        base: The fixed parts.
    """
    kinematics = find_kinematics()
    arm = kinematics.arm
    best: dict[str, Grasp | None] = {}
    crowded = set[str]()
    # The poses before the operation, of the parts that are assembled.
    now = {part: np.array(poses[part]) for part in (TABLE, *base)}
    for placing in order:
        main = placing.moves[0]
        solid = solids[main]
        fixture = {fixtures[main].name: fixtures[main]} if main in fixtures else {}
        at_start = {TABLE: now[TABLE], **{name: starts[name] for name in (main, *fixture)}}
        # A part that was put down before, as the base of a sub-assembly, is taken from there and not from its start.
        taken = _list_resting_parts({**solids, **fixture}, main, now if main in now else at_start, placing.moves)
        T = placing.at @ pose.inverse(poses[main])  # moves all carried parts rigidly to the goal of the operation
        now |= {part: T @ poses[part] for part in placing.moves}
        goal = _list_resting_parts(solids, main, now, placing.moves)
        lift = Stroke(taken.T, -UP, _LIFT_M, taken.around)
        strokes = (lift, _plan_stroke(solids, placing, now, goal))
        places = [*_list_holds_from_above(solid, taken.T, arm.opening_m)]
        clear = (find_clear_grasp(kinematics, solid, grasps, (taken, goal), strokes) for grasps in places)
        best[main] = next((grasp for grasp in clear if grasp is not None), None)
        # Without room for the gripper, keep the best place: a person may change it in the file.
        if best[main] is None and (offered := find_holds(solid, _up_in_part(goal.T), arm.opening_m)):
            best[main] = _make_grasp(offered[0])
            crowded.add(main)
    return GraspSearchResult(best, frozenset(crowded))


@lru_cache(maxsize=1)
def find_kinematics() -> Kinematics:
    """Return the kinematics of the arm for which grasps and starts are chosen."""
    return Kinematics(find_arm(_ARM))


class GoalRoom:
    """Whether the open gripper has room to hold each part at its goal, among any set of other parts."""

    def __init__(self, solids: Mapping[str, Solid], poses: Poses) -> None:
        """Take all parts at their final poses, world, [m]."""
        self._solids = solids
        self._poses = poses
        self._kinematics = find_kinematics()
        self._known = defaultdict[str, dict[frozenset[str], bool]](dict)

    def has_room(self, part: str, there: Sequence[str]) -> bool:
        """Whether some grasp of a part from above is clear of the parts that are there."""
        among = frozenset(there)
        for others, room in self._known[part].items():
            if (among <= others) if room else (among >= others):
                return room  # what has room among more parts has it among fewer
        goal = _list_resting_parts(self._solids, part, {name: self._poses[name] for name in there}, (part,))
        places = _list_holds_from_above(self._solids[part], goal.T, self._kinematics.arm.opening_m)
        clear = (find_clear_grasp(self._kinematics, self._solids[part], each, (goal,)) for each in places)
        room = any(grasp is not None for grasp in clear)
        self._known[part][among] = room
        return room


def _list_resting_parts(solids: Mapping[str, Solid], part: str, at: Poses, moves: Sequence[str]) -> RestingPart:
    """Return a part at rest and the obstacles around it: all parts of `at` but the moved ones."""
    return RestingPart(at[part], list_obstacles({name: solids[name] for name in at}, at, moves))


def _plan_stroke(solids: Mapping[str, Solid], placing: Placement, now: Poses, goal: RestingPart) -> Stroke:
    """Return the straight insertion path to the goal, and the obstacles at the goal.

    Args:
        now: Pose of every part after the operation.
        goal: The main part at its goal, with the obstacles there.
    """
    assembly = Assembly({part: solids[part] for part in now}, (), frozenset())
    arrival = plan_arrival(assembly, placing.moves, placing.contacts, now, Preference(placing.along))
    line = plan_arrival_line(arrival, goal.T)
    return Stroke(goal.T, line.direction, line.travel, goal.around)


def _list_holds_from_above(solid: Solid, T: Array, opening_m: float) -> Iterator[list[Grasp]]:
    """Yield the grasps from above for each height of the fingertips over the part, best first within each height.

    Args:
        T: (4, 4), pose of the part in the world.
    """
    up = _up_in_part(T)
    for over in _OVER_M:
        firm = (hold for hold in find_holds(solid, up, opening_m, over) if not _grazes(solid, hold, up))
        yield [_make_grasp(hold) for hold in _choose_best_by_height(firm, up)]


def _grazes(solid: Solid, hold: PadPlace, up: Array) -> bool:
    """Whether the upper or lower end of a pad lies just inside a piece, such as a chamfer, which it would push away."""
    axes = np.array([np.cross(up, hold.across), up, hold.across])
    half = np.array([[-PAD_M[0], PAD_M[0]], [-PAD_M[1], PAD_M[2]], [-hold.half_width, hold.half_width]])
    pad = half + (axes @ hold.point)[:, None]
    reach = _measure_extents(solid, tuple(map(tuple, np.round(axes, 9).tolist())))
    common = np.minimum(pad[:, 1], reach[:, :, 1]) - np.maximum(pad[:, 0], reach[:, :, 0])
    is_edge = common[:, 1] < np.minimum(_GRAZE_M, np.ptp(reach[:, 1], axis=1) - _SAME_M)
    return bool(((common > 0.0).all(axis=1) & is_edge).any())


@lru_cache(maxsize=64)
def _measure_extents(solid: Solid, axes: tuple[tuple[float, ...], ...]) -> Array:
    """Return the least and greatest coordinate of each piece along some axes, (pieces, axes, 2), [m]."""
    along = [np.array(axis) for axis in axes]
    return np.array([[measure_extent((piece,), axis) for axis in along] for piece in solid.pieces])


def _choose_best_by_height(places: Iterable[PadPlace], up: Array) -> Iterator[PadPlace]:
    """Yield at most `_MOST_HOLDS` places of each height, from places sorted best first.

    Every height is kept, since a high place, though a worse hold, may be the only one with room.
    """
    counts = Counter[float]()
    for place in places:
        height = round(float(place.point @ up), 6)
        counts[height] += 1
        if counts[height] <= _MOST_HOLDS:
            yield place


def _up_in_part(T: Array) -> Array:
    """Return the world's vertical in the frame of a part at T, (3,)."""
    return np.round(T[2, :3], 9)


def _make_grasp(hold: PadPlace) -> Grasp:
    return Grasp(hold.point, hold.across, hold.half_width, None)
