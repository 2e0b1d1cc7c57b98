"""Plan how a part comes into its contacts: its macros, and the straight line on which it arrives at its goal."""

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
from apo_bench.geometry import Array, PosedPieces, compute_exit_distance, freeze, is_path_free, measure_extent
from apo_bench.planning.insertion.attach_line import ANY, Attach, Preference
from apo_bench.planning.insertion.contact_states import (
    ANGLE_RAD,
    ContactState,
    Screw,
    classify_motions,
    classify_with_rotations,
    compute_null_space,
    snap_normals,
)
from apo_bench.planning.insertion.macros import UP, Macro, MacroChain, StraightExit, build_macro_chain, invert_macros

_CLEARING_M = 0.02
"""Added to the exit distance: gap between the part and the walls around its goal where the line begins."""
_TRAVEL_M = 0.03
"""Least length of the line, from its beginning to the goal."""
_LONGER_M = (0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16)
"""Lengths tried if something is above the beginning of every shorter line; not tried for vertical lines."""
_STRAIGHT = 0.99
"""A line counts as vertical if its cosine with the vertical is at least this."""
_OPENS = 0.015
"""Share of the sum of all normals added to one normal, for an exit that opens the other contacts slightly."""
CLEAR_M = 0.3
"""A part reaches the beginning of its line from above, so this height above it must be free."""
_LIFTED = 0.1
"""A contact opens when the part is lifted if the z component of its unit normal is above this."""
_SAME = 1e-9
"""Unit vectors with a smaller difference are equal."""


@final
@dataclass(frozen=True, eq=False)
class Arrival:
    """A part at its place, the macros and the line by which it comes there, and the macros by which it leaves."""

    main: str
    T: Array
    """(4, 4): pose of the main part at its place, world frame; so are all directions but that of `line`."""
    touched: tuple[TouchedContact, ...]
    chain: MacroChain
    """The macros by which the part comes; their contact numbers index `touched` (a round contact: once per normal)."""
    departs: tuple[Macro, ...]
    """The macros by which the part leaves again; a final lift off supports is not among them."""
    line: Attach
    """The line on which the part arrives, in the frame of the part."""
    free: bool
    """Whether the line, and the space above its beginning, are free of other parts."""

    def __post_init__(self) -> None:
        freeze(self, T=(4, 4))

    @property
    def state(self) -> ContactState:
        return self.chain.state

    @property
    def macros(self) -> tuple[Macro, ...]:
        return self.chain.macros

    def contacts(self, macro: Macro) -> tuple[Contact, ...]:
        """The contacts that a macro makes (`depart`: opens), each once."""
        return tuple(dict.fromkeys(self.touched[i].contact for i in macro.makes))

    def to_part_frame(self, direction: Array) -> Array:
        """A world direction, (3,), in the frame of the part."""
        return _to_part_frame(direction, self.T)

    @property
    def axes(self) -> tuple[Array, Array, Array]:
        """Three bases of world directions, each (k, 3), by what determines the position of the part along them.

        Returns:
            (position, felt, across): directions in which no contact constrains the part, so its position must be
            commanded; directions of the guarded macros, which end on contact; directions between walls that enclose the
            part.
        """
        cone = classify_motions(_merge_normals(self.touched))
        walls = cone.rows[~cone.detachable]
        position = _align_basis(compute_null_space(cone.rows), self.T)
        felt = np.array([macro.direction for macro in self.macros if macro.guarded]).reshape(-1, 3)
        across = _align_basis(compute_null_space(compute_null_space(walls)) if len(walls) else np.zeros((0, 3)), self.T)
        return position, felt, across


def plan_arrival(
    assembly: Assembly,
    moves: Sequence[str],
    contacts: Iterable[Contact],
    poses: Poses,
    stated: Preference = ANY,
    angle_rad: float = ANGLE_RAD,
) -> Arrival:
    """Plan how parts that move together come into their contacts.

    Args:
        moves: Names of the parts that move, the main part first.
        contacts: Contacts between moving and resting parts that are closed at the goal.
        poses: Of every part, with what moves at its goal, z upwards, [m]. No part may intersect another.
        stated: Preferred line, in the frame of the main part. Its direction is ignored if it leads through a contact.
        angle_rad: Normals within this angle are parallel; larger than rounding if the poses were observed.
    """
    T = poses[moves[0]]
    touched = tuple(find_touched_contacts(assembly, contacts, moves, poses))
    normals = _merge_normals(touched, angle_rad)
    moving = [PosedPieces(assembly.solids[part].pieces, poses[part]) for part in moves]
    resting = {
        part: PosedPieces(solid.pieces, poses[part]) for part, solid in assembly.solids.items() if part not in moves
    }
    direction = stated.direction
    if direction is not None and not classify_motions(normals).admits(
        -(T[:3, :3] @ direction), float(np.sin(angle_rad))
    ):
        direction = None

    # In the helpers below `way` is the unit vector of an exit from the goal, world frame.
    def along_is_free(way: Array, length_m: float) -> bool:
        """Whether the moving parts can move along `way` by a length."""
        return is_path_free(moving, way, length_m, list(resting.values()))

    def clear(way: Array, length_m: float) -> bool:
        """Whether an exit is free, and then the space above its end, from where the part descends."""
        begin = [PosedPieces(posed.pieces, _translated(posed.T, length_m * way)) for posed in moving]
        return along_is_free(way, length_m) and is_path_free(begin, UP, CLEAR_M, list(resting.values()))

    def reach(exit_m: float) -> float:
        """Length of the line for an exit distance, [m]."""
        # Line length: exit distance plus the gap, rounded up to whole millimetres unless a length is stated.
        millimetres = 1e-3 * float(np.ceil(1e3 * (exit_m + _CLEARING_M) - 1e-3))
        return max(_TRAVEL_M, millimetres) if stated.travel_m is None else stated.travel_m

    def out(along: Array, walls: tuple[int, ...]) -> StraightExit:
        """The first free exit between walls, by their numbers; the first candidate if none is free."""
        around = [resting[part] for part in dict.fromkeys(touched[i].rests for i in walls)]
        floors = [normals[i] for i in range(len(normals)) if i not in walls]  # contacts that the exit may open
        # A stated direction leads to the goal, so the exit goes the opposite way.
        there = [-(T[:3, :3] @ direction)] if direction is not None else _list_exits_between_walls(along, floors, T)

        def length(u: Array) -> float:
            """Exit distance along `u`, [m]."""
            # Round walls may end farther out than the solids around the part require.
            ends = (_measure_wall_exit(assembly, touched[i], poses, u) for i in walls)
            return max(compute_exit_distance(moving, u, around), *ends)

        ways = list[StraightExit]()
        for u in there:
            ways.append(StraightExit(u, length(u), False))
            if clear(u, reach(ways[-1].length_m)):
                return ways[-1]._replace(free=True)
        return ways[0]  # no exit is free: the first candidate, marked as not free

    # From here on: the part leaves walls on `macros.way`, otherwise an exit off open contacts is searched.
    macros = build_macro_chain(normals, out, float(np.sin(angle_rad)))
    if macros.way is not None:
        line = Attach(_to_part_frame(-macros.way.direction, T), reach(macros.way.length_m))
        is_free = macros.way.free
    else:
        there = list(_list_admissible_exits(macros, normals, T)) if direction is None else [-(T[:3, :3] @ direction)]
        # Parts that rest against the moving parts from above (contact normal downwards) are roofs to get out from
        # under.
        over = [resting[part] for part in dict.fromkeys(each.rests for each in touched if each.normal @ UP < -_LIFTED)]
        tried = [
            (way, reach(far)) for way in there for far in dict.fromkeys((0.0, _measure_roof_exit(moving, way, over)))
        ]
        # Slanted exits whose shortest extended line is free are tried with all longer lines.
        aslant = (way for way in there if stated.travel_m is None and abs(way @ UP) < _STRAIGHT)
        longer = product((way for way in aslant if along_is_free(way, _LONGER_M[0])), _LONGER_M)
        found_free = next((each for each in chained(tried, longer) if clear(*each)), None)
        way, length_m = found_free or tried[0]
        is_free = found_free is not None
        line = Attach(_to_part_frame(-way, T), length_m)
    if direction is not None:
        line = Attach(direction, line.travel_m)
    # Contacts that carry the part, since their normals point upwards.
    supports = tuple(i for i, n in enumerate(normals) if n @ UP > _LIFTED)
    return Arrival(moves[0], T, touched, macros, invert_macros(macros, supports), line, is_free and not macros.locked)


def _measure_wall_exit(assembly: Assembly, touched: TouchedContact, poses: Poses, way: Array) -> float:
    """Exit distance of a part along `way` until round walls no longer enclose it, [m]; 0 for flat contacts.

    A loose fit counts as enclosing, too.
    """
    if touched.points is None:  # a flat contact
        return 0.0
    m, e = touched.contact
    # The resting feature comes first; the measured insertion goes against the exit.
    return measure_entrance_depth(assembly, *((e, m) if touched.rests == m.part else (m, e)), poses, -way)


def _measure_roof_exit(moving: Sequence[PosedPieces], way: Array, roofs: Sequence[PosedPieces]) -> float:
    """Distance along `way` after which no moving part is under a roof, [m]; 0 without roofs or if `way` is steep.

    Args:
        way: Unit vector of the exit, (3,), world frame.
        roofs: Parts above the moving ones.
    """
    # Extents along `way` of moving parts, ends[0], and of roofs, ends[1], in the world frame.
    ends = [
        [np.add(measure_extent(p.pieces, p.T[:3, :3].T @ way), p.T[:3, 3] @ way) for p in of] for of in (moving, roofs)
    ]
    return max(0.0, float(np.max(ends[1]) - np.min(ends[0]))) if roofs and abs(way @ UP) < 0.5 else 0.0


def compute_screw_state(assembly: Assembly, arrival: Arrival, poses: Poses) -> Screw:
    """Contact state of an arrived part with rotations included (screws); `poses` as given to `plan_arrival`."""
    return classify_with_rotations(*find_touch_points(assembly, arrival.touched, poses))


def _align_basis(basis: Array, T: Array) -> Array:
    """A basis, (m, 3), of the span of `basis` that is easy to read: axes of the part come first."""
    axes: list[Array] = []
    inside = [axis for axis in T[:3, :3].T if np.linalg.norm(basis.T @ (basis @ axis) - axis) < 1e-6]
    for axis in (*inside, *basis):
        rest = basis.T @ (basis @ axis)
        # Gram-Schmidt: remove what earlier axes already span.
        rest = rest - sum(((rest @ other) * other for other in axes), np.zeros(3))
        if np.linalg.norm(rest) > 1e-6 and len(axes) < len(basis):
            axes.append(rest / np.linalg.norm(rest) + 0.0)
    return np.array(axes).reshape(-1, 3)


def _list_admissible_exits(macros: MacroChain, normals: Array, T: Array) -> Iterator[Array]:
    """Candidate exits, unit vectors (3,), off contacts that do not enclose the part, the best first.

    The order: straight up; against the first and the last macro; the direction that opens all contacts; axes of the
    part; each normal, first tilted to open the other contacts slightly. Only exits that close no contact are yielded.
    """
    cone = classify_motions(normals)
    if macros.locked:  # no straight exit exists: any direction serves
        yield UP
        return
    back = [-macros.macros[i].direction for i in (0, -1)] if macros.macros else []
    inside = [cone.direction] if cone.direction.any() else []
    axes = [sign * axis for axis in T[:3, :3].T for sign in (-1.0, 1.0)]
    aslant = normals + _OPENS * normals.sum(axis=0)
    aslant /= np.linalg.norm(aslant, axis=1)[:, None]
    yield from (way for way in (UP, *back, *inside, *axes, *aslant, *normals) if cone.admits(way))


def _list_exits_between_walls(along: Array, floors: Sequence[Array], T: Array) -> Iterator[Array]:
    """Candidate exits between walls, unit vectors (3,) in the span of `along`, the best first.

    The order: up, off the floors, the axes of the part (negative before positive), then the rows of `along`.

    Args:
        along: Directions in which all walls stay closed, orthonormal, (m, 3).
        floors: Normals of the contacts that are not walls.
    """
    axes = [sign * axis for sign in (-1.0, 1.0) for axis in T[:3, :3].T]
    for way in (UP, *floors, *axes, *(-along), *along):
        within = along.T @ (along @ way)
        size = float(np.linalg.norm(within))
        if size > 0.5:  # candidates more than 60 degrees off the span are skipped
            yield np.round(within / size, 12) + 0.0


def _merge_normals(touched: Sequence[TouchedContact], angle_rad: float = ANGLE_RAD) -> Array:
    """Unit normals of contacts, (k, 3), with those within `angle_rad` of each other made equal."""
    return snap_normals(np.array([each.normal for each in touched]).reshape(-1, 3), angle_rad)


def _to_part_frame(direction: Array, T: Array) -> Array:
    """A world direction, (3,), in the frame of a part at T; straight down stays exact, all else is rounded."""
    if np.linalg.norm(direction + UP) < _SAME:
        return np.asarray(T[:3, :3].T @ -UP)
    return np.asarray(np.round(T[:3, :3].T @ direction, 12) + 0.0)


def _translated(T: Array, by: Array) -> Array:
    out = np.array(T)
    out[:3, 3] += by
    return out
