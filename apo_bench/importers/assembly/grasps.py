"""Find where each part of a new scenario is held from above, by the same rules as the robot's."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, PadPlace, Solid, find_holds, pose
from apo_bench.importers.assembly.ordering import Placing
from apo_bench.importers.assembly.posed import TABLE
from apo_bench.planning.insertion.arrival import arrive
from apo_bench.planning.insertion.macros import UP
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import RestingPart, Stroke, find_clear_grasp, list_obstacles, plan_arrival_line

_ARM = "six_axis"
_OVER_M = (0.0, 0.005, 0.0085)
"""How far tips may be over the top of a part that stands out little; pads hold its uppermost 5 or 1.5 mm then."""
_MOST_HOLDS = 40
"""The largest number of places that are tried, of each height."""
_LIFT_M = 0.03


class FoundGrasps(NamedTuple):
    """How the parts of a scenario are held."""

    grasps: Mapping[str, Grasp | None]
    crowded: frozenset[str]
    """Parts that offer places, of which none has room."""


def find_grasps(
    solids: Mapping[str, Solid],
    poses: Poses,
    starts: Poses,
    fixtures: Mapping[str, Solid],
    order: Sequence[Placing],
    base: Sequence[str],
) -> FoundGrasps:
    """Return the best place of each part at which the gripper has room: at its start, at its goal and on its way in.

    Args:
        starts: Of every part and fixture, world.
        fixtures: Part -> its fixture at the start.
    """
    arm = find_arm(_ARM)
    kinematics = Kinematics(arm)
    best: dict[str, Grasp | None] = {}
    crowded = set[str]()
    now = {part: np.array(poses[part]) for part in (TABLE, *base)}
    for placing in order:
        main = placing.moves[0]
        solid = solids[main]
        fixture = {fixtures[main].name: fixtures[main]} if main in fixtures else {}
        at_start = {TABLE: now[TABLE], **{name: starts[name] for name in (main, *fixture)}}
        taken = _resting({**solids, **fixture}, main, now if main in now else at_start, placing.moves)
        T = placing.at @ pose.inverse(poses[main])
        now |= {part: T @ poses[part] for part in placing.moves}
        goal = _resting(solids, main, now, placing.moves)
        lift = Stroke(taken.T, -UP, _LIFT_M, taken.around)
        strokes = (lift, _stroke(solids, placing, now, goal))
        places = [*_places_from_above(solid, taken.T, arm.opening_m)]
        clear = (find_clear_grasp(kinematics, solid, grasps, (taken, goal), strokes) for grasps in places)
        best[main] = next((grasp for grasp in clear if grasp is not None), None)
        if best[main] is None and (offered := find_holds(solid, _up(goal.T), arm.opening_m)):
            best[main] = _grasp(offered[0])
            crowded.add(main)
    return FoundGrasps(best, frozenset(crowded))


def _resting(solids: Mapping[str, Solid], part: str, at: Poses, moves: Sequence[str]) -> RestingPart:
    return RestingPart(at[part], list_obstacles({name: solids[name] for name in at}, at, moves))


def _stroke(solids: Mapping[str, Solid], placing: Placing, now: Poses, goal: RestingPart) -> Stroke:
    """The way in."""
    assembly = Assembly({part: solids[part] for part in now}, (), frozenset())
    line = plan_arrival_line(arrive(assembly, placing.moves, placing.contacts, now), goal.T)
    return Stroke(goal.T, line.direction, line.travel, goal.around)


def _places_from_above(solid: Solid, T: Array, opening_m: float) -> Iterator[list[Grasp]]:
    """Places of one height of the tips over the part after the other."""
    up = _up(T)
    for over in _OVER_M:
        yield [_grasp(hold) for hold in _best_of_each_height(find_holds(solid, up, opening_m, over), up)]


def _best_of_each_height(places: Sequence[PadPlace], up: Array) -> Iterator[PadPlace]:
    """The first places of each height: the highest are the worst, and may be the only ones with room."""
    counts = Counter[float]()
    for place in places:
        height = round(float(place.point @ up), 6)
        counts[height] += 1
        if counts[height] <= _MOST_HOLDS:
            yield place


def _up(T: Array) -> Array:
    return np.round(T[2, :3], 9)


def _grasp(hold: PadPlace) -> Grasp:
    return Grasp(hold.point, hold.across, hold.half_width, None)
