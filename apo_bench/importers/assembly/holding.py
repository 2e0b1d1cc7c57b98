"""Where each part of a draft is held, by the same judgement as the robot's: from above, else pinched, else tilted."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, PadPlace, Solid, holds, pose
from apo_bench.importers.assembly.ordering import Placing
from apo_bench.importers.assembly.posed import TABLE
from apo_bench.planning.insertion.arrival import arrive
from apo_bench.planning.insertion.macros import UP
from apo_bench.scenario.scenario import Grasp, Site
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import RestingPart, Stroke, arrival_line, first_clear, hover, obstacles, tip_frame

_ARM = "six_axis"
_OVER_M = (0.0, 0.005, 0.0085)
"""How far tips may be over the top of a part that stands out little; pads hold its uppermost 5 or 1.5 mm then."""
_TILTS = np.radians([15.0, -15.0, 30.0, -30.0, 45.0, -45.0])
_MOST_HOLDS = 40
"""So many places are looked at, of each height and tilt."""
_VERTICAL = 0.99
_LIFT_M = 0.03
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


class _Way(NamedTuple):
    """Where a part is taken, where it is put, and how it comes there."""

    places: tuple[RestingPart, RestingPart]
    strokes: tuple[Stroke, Stroke]
    """Off where it is taken, backwards, and the way in."""


class Holds(NamedTuple):
    """How the parts of a draft are held."""

    grasps: Mapping[str, Grasp | None]
    crowded: frozenset[str]
    """Parts that offer places, of which none has room."""


def found_holds(
    solids: Mapping[str, Solid],
    poses: Poses,
    starts: Poses,
    nests: Mapping[str, Solid],
    order: Sequence[Placing],
    base: Sequence[str],
    site: Site,
) -> Holds:
    """Where each part is held: the best place at which the gripper has room where it is taken, put and on its way in.

    Args:
        starts: Where every part waits, world, and every nest.
        nests: Part -> what it waits in.
    """
    arm = find_arm(_ARM)
    kinematics = Kinematics(arm)
    best: dict[str, Grasp | None] = {}
    crowded = set[str]()
    now = {part: np.array(poses[part]) for part in (TABLE, *base)}
    for placing in order:
        main = placing.moves[0]
        nest = {nests[main].name: nests[main]} if main in nests else {}
        waits = {TABLE: now[TABLE], main: starts[main], **{name: starts[name] for name in nest}}
        taken = _resting({**solids, **nest}, main, now if main in now else waits, placing.moves)
        T = placing.at @ pose.inverse(poses[main])
        now |= {part: T @ poses[part] for part in placing.moves}
        goal = _resting(solids, main, now, placing.moves)
        lift = Stroke(taken.T, -UP, _LIFT_M, taken.around)
        way = _Way((taken, goal), (lift, _stroke(solids, placing, now, goal)))
        best[main] = _best(kinematics, solids[main], way, site)
        if best[main] is None and (offered := holds(solids[main], _up(goal.T), arm.opening_m)):
            best[main] = _grasp(offered[0])
            crowded.add(main)
    return Holds(best, frozenset(crowded))


def _resting(solids: Mapping[str, Solid], part: str, at: Poses, moves: Sequence[str]) -> RestingPart:
    return RestingPart(at[part], obstacles({name: solids[name] for name in at}, at, moves))


def _stroke(solids: Mapping[str, Solid], placing: Placing, now: Poses, goal: RestingPart) -> Stroke:
    """The way in."""
    assembly = Assembly({part: solids[part] for part in now}, (), frozenset())
    line = arrival_line(arrive(assembly, placing.moves, placing.contacts, now), goal.T)
    return Stroke(goal.T, line.way, line.travel, goal.around)


def _best(kinematics: Kinematics, solid: Solid, way: _Way, site: Site) -> Grasp | None:
    """The first place that is free and in reach; what comes level may be held by two, which the robot then finds."""
    for grasps in _offered(solid, way.places[0].T, kinematics.arm.opening_m):
        free = first_clear(kinematics, solid, grasps, way.places, way.strokes)
        if free is not None and (free.ahead is None or _reached(kinematics, free, way, site)):
            return free
    return None


def _offered(solid: Solid, T: Array, opening_m: float) -> Iterator[list[Grasp]]:
    """Places from above, of one height over the part after the other, then of hands that are tilted about `across`."""
    up = _up(T)
    for over in _OVER_M:
        yield [_grasp(hold) for hold in _best_of_each_height(holds(solid, up, opening_m, over), up)]
    ways = {tuple(np.round(hold.across, 9).tolist()): hold.across for hold in holds(solid, up, opening_m, _OVER_M[-1])}
    for tilt, across in product(_TILTS, ways.values()):
        back = pose.exp(np.append(np.zeros(3), tilt * across))[:3, :3] @ up
        places = _best_of_each_height(holds(solid, back, opening_m, _OVER_M[1]), back)
        yield [_grasp(hold, -back) for hold in places if abs(hold.across @ across) > _VERTICAL]


def _best_of_each_height(places: Sequence[PadPlace], up: Array) -> Iterator[PadPlace]:
    """The best of what is ordered by how good it is: the highest are the worst, and may be the only ones with room."""
    counts = Counter[float]()
    for place in places:
        height = round(float(place.point @ up), 6)
        counts[height] += 1
        if counts[height] <= _MOST_HOLDS:
            yield place


def _up(T: Array) -> Array:
    return np.round(T[2, :3], 9)


def _grasp(hold: PadPlace, ahead: Array | None = None) -> Grasp:
    return Grasp(hold.point, hold.across, hold.half_width, ahead)


def _reached(kinematics: Kinematics, grasp: Grasp, way: _Way, site: Site) -> bool:
    """Whether the arm reaches a tilted grasp where the part waits, and where the site may put it."""
    start, goal = (place.T @ tip_frame(grasp, place.T) for place in way.places)
    sites = [pose.at((*site.center_m, 0.0), (0.0, 0.0, np.degrees(yaw))) for yaw in (*site.yaw_rad, 0.0)]
    tips = [tip for at in (start, *(T @ goal for T in sites)) for tip in (at, hover(at))]
    home = np.array(kinematics.arm.home)
    return any(
        all(kinematics.inverse(tip @ turn, home) is not None for tip in tips) for turn in (np.eye(4), _HALF_TURN)
    )
