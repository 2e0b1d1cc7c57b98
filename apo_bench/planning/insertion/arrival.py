"""How a part comes into its contacts: its macros, and the straight line on which it arrives."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain as chained
from itertools import product
from typing import final

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    Poses,
    TouchedContact,
    find_touch_points,
    find_touched_contacts,
    measure_entrance_depth,
)
from apo_bench.geometry import Array, PosedPieces, compute_exit_distance, freeze, is_way_free, measure_extent
from apo_bench.planning.insertion.attach import ANY, Attach, Preference
from apo_bench.planning.insertion.macros import UP, Chain, Macro, StraightExit, chain, departure
from apo_bench.planning.insertion.states import (
    ANGLE_RAD,
    ContactState,
    Screw,
    classify,
    null_space,
    screw_state,
    snap_normals,
)

_ROOM_M = 0.02
"""A part begins its way in so far outside of what it goes into."""
_TRAVEL_M = 0.03
"""How far before its goal the line begins at least."""
_LONGER_M = (0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16)
"""Where it is roofed there, the line is longer, unless it is as good as vertical."""
_STRAIGHT = 0.99
_OPENS = 0.015
CLEAR_M = 0.3
"""A part comes from above to where its way in begins: so much above that place must be free."""
_LIFTED = 0.1
"""A contact opens when the part is lifted if the sine of its normal to the level is above this."""
_SAME = 1e-9


@final
@dataclass(frozen=True, eq=False)
class Arrival:
    """A part at a place, and how it comes there."""

    main: str
    T: Array
    """(4, 4), where the main part then is; directions below are in the frame of the same world."""
    touched: tuple[TouchedContact, ...]
    chain: Chain
    """The macros by which the part comes; `touched` by number, in which a round contact stands once per normal."""
    departs: tuple[Macro, ...]
    """By which the part leaves again, apart from being lifted."""
    line: Attach
    """The line on which it arrives, in its own frame."""
    free: bool
    """Whether nothing is in the way of that line, nor above its beginning."""

    def __post_init__(self) -> None:
        freeze(self, T=(4, 4))

    @property
    def state(self) -> ContactState:
        return self.chain.state

    @property
    def macros(self) -> tuple[Macro, ...]:
        return self.chain.macros

    def contacts(self, macro: Macro) -> tuple[Contact, ...]:
        """The contacts that a macro makes, or opens, each once."""
        return tuple(dict.fromkeys(self.touched[i].contact for i in macro.makes))

    def own(self, direction: Array) -> Array:
        """A direction, (3,), in the frame of the part."""
        return _to_part_frame(direction, self.T)

    @property
    def axes(self) -> tuple[Array, Array, Array]:
        """Directions of the part's place, each (k, 3): settled by position, by feeling, by walls."""
        cone = classify(_normals(self.touched))
        walls = cone.rows[~cone.detachable]
        position = _readable(null_space(cone.rows), self.T)
        felt = np.array([macro.direction for macro in self.macros if macro.guarded]).reshape(-1, 3)
        across = _readable(null_space(null_space(walls)) if len(walls) else np.zeros((0, 3)), self.T)
        return position, felt, across


def arrive(
    assembly: Assembly,
    moves: Sequence[str],
    contacts: Iterable[Contact],
    poses: Poses,
    stated: Preference = ANY,
    angle_rad: float = ANGLE_RAD,
) -> Arrival:
    """How what moves, the main part first, comes into its contacts.

    Args:
        poses: Every part, what moves at its goal, z upwards, [m]. Nothing else may be inside of anything.
        stated: A line to be preferred, in the frame of the main part; one that leads through a contact is not.
        angle_rad: Normals this near to parallel are; more than rounding where poses were only seen.
    """
    T = poses[moves[0]]
    touched = tuple(find_touched_contacts(assembly, contacts, moves, poses))
    normals = _normals(touched, angle_rad)
    moving = [PosedPieces(assembly.solids[part].pieces, poses[part]) for part in moves]
    resting = {
        part: PosedPieces(solid.pieces, poses[part]) for part, solid in assembly.solids.items() if part not in moves
    }
    direction = stated.direction
    if direction is not None and not classify(normals).admits(-(T[:3, :3] @ direction), float(np.sin(angle_rad))):
        direction = None

    def along_is_free(way: Array, length_m: float) -> bool:
        return is_way_free(moving, way, length_m, list(resting.values()))

    def clear(way: Array, length_m: float) -> bool:
        begin = [PosedPieces(posed.pieces, _shift(posed.T, length_m * way)) for posed in moving]
        return along_is_free(way, length_m) and is_way_free(begin, UP, CLEAR_M, list(resting.values()))

    def reach(exit_m: float) -> float:
        # For a part that is free after a way the line is as long as that and some room, in whole millimetres.
        millimetres = 1e-3 * float(np.ceil(1e3 * (exit_m + _ROOM_M) - 1e-3))
        return max(_TRAVEL_M, millimetres) if stated.travel_m is None else stated.travel_m

    def out(along: Array, walls: tuple[int, ...]) -> StraightExit:
        around = [resting[part] for part in dict.fromkeys(touched[i].rests for i in walls)]
        floors = [normals[i] for i in range(len(normals)) if i not in walls]
        there = [-(T[:3, :3] @ direction)] if direction is not None else _directions(along, floors, T)

        def length(u: Array) -> float:
            ends = (_out_of(assembly, touched[i], poses, u) for i in walls)
            return max(compute_exit_distance(moving, u, around), *ends)

        ways = list[StraightExit]()
        for u in there:
            ways.append(StraightExit(u, length(u), False))
            if clear(u, reach(ways[-1].length_m)):
                return ways[-1]._replace(free=True)
        return ways[0]

    macros = chain(normals, out, float(np.sin(angle_rad)))
    if macros.way is not None:
        line = Attach(_to_part_frame(-macros.way.direction, T), reach(macros.way.length_m))
        is_free = macros.way.free
    else:
        there = list(_admissible(macros, normals, T)) if direction is None else [-(T[:3, :3] @ direction)]
        over = [resting[part] for part in dict.fromkeys(each.rests for each in touched if each.normal @ UP < -_LIFTED)]
        tried = [(way, reach(far)) for way in there for far in dict.fromkeys((0.0, _past(moving, way, over)))]
        aslant = (way for way in there if stated.travel_m is None and abs(way @ UP) < _STRAIGHT)
        longer = product((way for way in aslant if along_is_free(way, _LONGER_M[0])), _LONGER_M)
        found_free = next((each for each in chained(tried, longer) if clear(*each)), None)
        way, length_m = found_free or tried[0]
        is_free = found_free is not None
        line = Attach(_to_part_frame(-way, T), length_m)
    if direction is not None:
        line = Attach(direction, line.travel_m)
    supports = tuple(i for i, n in enumerate(normals) if n @ UP > _LIFTED)
    return Arrival(moves[0], T, touched, macros, departure(macros, supports), line, is_free and not macros.locked)


def _out_of(assembly: Assembly, touched: TouchedContact, poses: Poses, way: Array) -> float:
    """How far a part must be moved until round walls no longer enclose it, however loosely, [m]; 0 of flat ones."""
    if touched.points is None:
        return 0.0
    m, e = touched.contact
    return measure_entrance_depth(assembly, *((e, m) if touched.rests == m.part else (m, e)), poses, -way)


def _past(moving: Sequence[PosedPieces], way: Array, roofs: Sequence[PosedPieces]) -> float:
    """How far parts must be moved until no roof is above any of them, at most, [m]."""
    ends = [
        [np.add(measure_extent(p.pieces, p.T[:3, :3].T @ way), p.T[:3, 3] @ way) for p in of] for of in (moving, roofs)
    ]
    return max(0.0, float(np.max(ends[1]) - np.min(ends[0]))) if roofs and abs(way @ UP) < 0.5 else 0.0


def turning_state(assembly: Assembly, arrival: Arrival, poses: Poses) -> Screw:
    """The state of what has arrived if it may also turn; `poses` as it was understood at."""
    return screw_state(*find_touch_points(assembly, arrival.touched, poses))


def _readable(basis: Array, T: Array) -> Array:
    """A basis of the span of (m, 3) that people can read: axes of the part at T that lie in it, then what is left."""
    axes: list[Array] = []
    inside = [axis for axis in T[:3, :3].T if np.linalg.norm(basis.T @ (basis @ axis) - axis) < 1e-6]
    for axis in (*inside, *basis):
        rest = basis.T @ (basis @ axis)
        rest = rest - sum(((rest @ other) * other for other in axes), np.zeros(3))
        if np.linalg.norm(rest) > 1e-6 and len(axes) < len(basis):
            axes.append(rest / np.linalg.norm(rest) + 0.0)
    return np.array(axes).reshape(-1, 3)


def _admissible(macros: Chain, normals: Array, T: Array) -> Iterator[Array]:
    """Ways off contacts that enclose nothing: straight up if that is one, as the first contact or the last one opens,
    any other, at last off each, opening the others a little or not at all."""
    cone = classify(normals)
    if macros.locked:
        yield UP
        return
    back = [-macros.macros[i].direction for i in (0, -1)] if macros.macros else []
    inside = [cone.direction] if cone.direction.any() else []
    axes = [sign * axis for axis in T[:3, :3].T for sign in (-1.0, 1.0)]
    aslant = normals + _OPENS * normals.sum(axis=0)
    aslant /= np.linalg.norm(aslant, axis=1)[:, None]
    yield from (way for way in (UP, *back, *inside, *axes, *aslant, *normals) if cone.admits(way))


def _directions(along: Array, floors: Sequence[Array], T: Array) -> Iterator[Array]:
    """Ways out between walls: up, off the floor, and along the axes of the part, backwards before forwards."""
    axes = [sign * axis for sign in (-1.0, 1.0) for axis in T[:3, :3].T]
    for way in (UP, *floors, *axes, *(-along), *along):
        within = along.T @ (along @ way)
        size = float(np.linalg.norm(within))
        if size > 0.5:
            yield np.round(within / size, 12) + 0.0


def _normals(touched: Sequence[TouchedContact], angle_rad: float = ANGLE_RAD) -> Array:
    return snap_normals(np.array([each.normal for each in touched]).reshape(-1, 3), angle_rad)


def _to_part_frame(direction: Array, T: Array) -> Array:
    """A direction in the frame of the part; exact where it is vertical."""
    if np.linalg.norm(direction + UP) < _SAME:
        return np.asarray(T[:3, :3].T @ -UP)
    return np.asarray(np.round(T[:3, :3].T @ direction, 12) + 0.0)


def _shift(T: Array, by: Array) -> Array:
    out = np.array(T)
    out[:3, 3] += by
    return out
