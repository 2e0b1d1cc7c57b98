"""Make a scenario from parts at their final poses: choose contacts, order, starts, fixtures and grasps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array, Solid, measure_extent, pose
from apo_bench.importers.assembly.contact_search import (
    close_contacts,
    find_clashes,
    find_contacts,
    find_walls_without_play,
)
from apo_bench.importers.assembly.fixtures import FLOOR_M, make_fixture
from apo_bench.importers.assembly.free_turns import list_meshing_parts
from apo_bench.importers.assembly.grasps import GoalRoom, GraspSearchResult, find_grasps, find_kinematics
from apo_bench.importers.assembly.order_search import OrderSearch, Placement
from apo_bench.importers.assembly.posed_parts import TABLE, PosedPart
from apo_bench.importers.assembly.staging import (
    FARTHEST_M,
    Stance,
    choose_site,
    find_reach,
    find_stance,
    stage_parts,
)
from apo_bench.importers.assembly.start_reach import list_unreachable_starts
from apo_bench.importers.cad.solids import find_free_name
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.scenario import Grasp, Site

_LOW_M = 1e-4  # parts this close to the lowest one stand on the table too
_PLAY_M = 1e-3
"""Opposite flat walls with a gap below this were drawn as a fit with play."""
_GROUP_ROOM_M = 0.05  # between the assembly and a sub-assembly next to it
_FARTHEST_ASIDE_M = 0.26  # largest distance of a sub-assembly from the assembly


@final
@dataclass(frozen=True, eq=False)
class NewScenario:
    """A new scenario before it is written to a file."""

    parts: tuple[PosedPart, ...]
    """The parts at the poses at which all contacts are closed, on the table."""
    fixed: tuple[str, ...]
    why_fixed: str  # the reason for the choice of the fixed parts, for a comment
    order: tuple[Placement, ...]
    starts: Mapping[str, Array]
    """Part or fixture -> its start pose, (4, 4), world; of fixed parts the pose in the frame of the assembly, [m]."""
    stances: Mapping[str, Stance]  # moved part -> how it stands at its start
    fixtures: Mapping[str, Solid]
    """Part -> the fixture that carries it at its start; only parts that do not stand on their own."""
    grasps: Mapping[str, Grasp | None]  # moved part -> its grasp, None without a place to hold
    site: Site
    clearance_mm: float  # clearance per side of faces marked as fit
    notes: tuple[str, ...]
    """Notes for the user, one sentence each; they become comments of the file."""
    unfit: tuple[str, ...]
    """The notes on parts that the robot cannot grasp, also among `notes`."""
    up: str = "z"
    """The axis of the given poses that is up, and the reason for it."""


class NoAssemblyOrder(RuntimeError):
    """Parts cannot be put together one after the other, with this side up."""


def new_scenario(
    parts: Sequence[PosedPart],
    fixed: Sequence[str] = (),
    clearance_mm: float = 0.25,
    wanted_order: Sequence[str] = (),
) -> NewScenario:
    """Make a scenario from parts that stand on the table as `place_on_table` puts them.

    Args:
        fixed: Names of parts that stay in place; empty: the largest of the lowest parts.
        clearance_mm: Clearance per side of faces that part files mark as fit.
        wanted_order: The moved parts in the wanted order; empty: any order.

    Raises:
        InputError: No part has that name, there is no room on the table, or the wanted order is impossible.
        RuntimeError: Parts are inside each other.
        NoAssemblyOrder: There is no order in which they can be put together.
    """
    solids = {each.name: each.solid for each in parts}
    for name in fixed:
        require_known("part", name, solids)
    base = tuple(fixed) or find_lowest_part(parts)[:1]
    why_fixed = "as asked" if fixed else "the largest of the lowest"
    solids |= {TABLE: load_part(TABLE)}
    poses: Poses = {each.name: each.T for each in parts} | {TABLE: np.eye(4)}
    clashes = find_clashes(solids, poses, clearance_mm)
    if clashes:
        raise RuntimeError("; ".join(clashes) + ".")
    poses, contacts, dropped = close_contacts(solids, poses, find_contacts(solids, poses), (TABLE, *base))
    apart = set(find_contacts(solids, poses, _PLAY_M)) - {*contacts, *dropped}
    walls = find_walls_without_play(solids, poses, sorted(apart))
    loose = {frozenset(of.part for of in pair[0]): pair for pair in walls}
    notes = [
        *(f"'{contact}' touches, but not exactly where the other contacts put it: left out" for contact in dropped),
        *(
            f"'{contact}' and '{opposite}' leave no play between them; state fit = true for its faces"
            for contact, opposite in find_walls_without_play(solids, poses, contacts)
        ),
        *(
            f"'{contact}' and '{opposite}' have play as drawn, so they are no contacts and correct nothing, like other "
            "walls of these two parts; draw them line to line, and the added clearance gives them play"
            for contact, opposite in loose.values()
        ),
    ]
    reach = find_reach(solids, poses, [each.name for each in parts])
    aside = np.array([-min(2.0 * reach + _GROUP_ROOM_M, _FARTHEST_ASIDE_M), 0.0, 0.0])
    held = {each.name for each in parts if each.held}
    room = GoalRoom(solids, poses)
    search = OrderSearch(solids, poses, contacts, aside, wanted_order, held, room.has_room)
    order = search.find(frozenset(base))
    if order is None:
        raise NoAssemblyOrder(
            "; ".join(["there is no order in which these parts can be put together", *search.describe_stuck_parts()])
            + "."
        )
    mains = [placing.moves[0] for placing in order]
    require(
        not wanted_order or mains == list(wanted_order),
        f"in the order {', '.join(wanted_order)} these parts cannot be put together; {', '.join(mains)} can be: name "
        "every part once that is not fixed, an inner part before the outer one.",
    )
    # Keep starts clear of the site of the assembly, and of the place next to it where a sub-assembly is put together.
    is_beside = any(np.linalg.norm(placing.at - poses[placing.moves[0]]) > _LOW_M for placing in order)
    site = choose_site(reach, is_beside)
    middles = [site.center_m, site.center_m + aside[:2]] if is_beside else [site.center_m]
    kept_free = [(np.array(middle), reach + max(site.spread_m)) for middle in middles]
    turns = {each.name: poses[each.name][:3, :3] for each in parts if each.name not in base}
    staged, found = _stage_in_reach(solids, poses, turns, order, base, kept_free)
    notes += [*staged.notes, *list_meshing_parts(solids, poses, order, base)]
    unfit = tuple(_find_unfit_parts(solids, turns, found))
    return NewScenario(
        parts=tuple(replace(each, T=poses[each.name]) for each in parts),
        fixed=base,
        why_fixed=why_fixed,
        order=order,
        starts=staged.starts,
        stances=staged.stances,
        fixtures=staged.fixtures,
        grasps=found.grasps,
        site=site,
        clearance_mm=clearance_mm,
        notes=(*notes, *unfit),
        unfit=unfit,
    )


class _Staged(NamedTuple):
    """Where parts start, with notes for the user; the fields are those of `NewScenario`."""

    starts: Mapping[str, Array]
    stances: Mapping[str, Stance]
    fixtures: Mapping[str, Solid]
    notes: list[str]


def _stage_in_reach(
    solids: Mapping[str, Solid],
    poses: Poses,
    turns: Mapping[str, Array],
    order: Sequence[Placement],
    base: Sequence[str],
    kept_free: Sequence[tuple[Array, float]],
) -> tuple[_Staged, GraspSearchResult]:
    """Return starts and grasps, with the starts nearer to the arm where it cannot lift a part high enough farther away.

    Args:
        turns: Moved part -> its orientation, (3, 3).
        kept_free: Discs that must stay free, each its centre, (2,), and its radius, [m].
    """
    kinematics = find_kinematics()
    first: tuple[_Staged, GraspSearchResult] | None = None
    for farthest_m in FARTHEST_M:
        try:
            staged = _stage(solids, poses, turns, stage_parts(solids, turns, kept_free, farthest_m))
        except InputError:
            if first is None:
                raise
            break
        found = find_grasps(solids, poses, staged.starts, staged.fixtures, order, base)
        first = first or (staged, found)
        starts = {**staged.starts, TABLE: poses[TABLE]}
        assembly = Assembly({part: solids[part] for part in (*base, *turns, TABLE)}, (), frozenset())
        if not list_unreachable_starts(kinematics, assembly, starts, order, found.grasps):
            return staged, found
    assert first is not None
    return first


def _stage(
    solids: Mapping[str, Solid], poses: Poses, turns: Mapping[str, Array], places: Mapping[str, Array]
) -> _Staged:
    """Return the starts of all parts, each moved part in its final orientation, in a fixture if it does not stand.

    Args:
        places: Moved part -> x and y of its frame, (2,), [m].
    """
    stances = {part: find_stance(solids[part], R) for part, R in turns.items()}
    starts = {part: np.array(poses[part]) for part in solids if part != TABLE}
    fixtures = dict[str, Solid]()
    notes = list[str]()
    for part, at in places.items():
        starts[part][:3, 3] = (*at, stances[part].height_m)
        if not stances[part].stands:
            starts[part][2, 3] += FLOOR_M
            fixtures[part] = make_fixture(find_free_name(f"fixture_{part}", solids), solids[part], turns[part])
            starts[fixtures[part].name] = pose.at((*at, 0.0))
            notes.append(f"'{part}' starts in a fixture made for it: it does not stand on the table")
        elif stances[part].rolls:
            notes.append(f"'{part}' lies on a round wall at its start and may roll")
    return _Staged(starts, stances, fixtures, notes)


def find_lowest_part(parts: Sequence[PosedPart]) -> tuple[str, ...]:
    """Return the parts that lie on the table, the largest first."""
    low = {each.name: measure_extent(each.solid.pieces, each.T[2, :3])[0] + float(each.T[2, 3]) for each in parts}
    lie = [each for each in parts if low[each.name] < min(low.values()) + _LOW_M]
    return tuple(each.name for each in sorted(lie, key=lambda each: -each.solid.volume))


def _find_unfit_parts(
    solids: Mapping[str, Solid], turns: Mapping[str, Array], found: GraspSearchResult
) -> Iterator[str]:
    """Yield a note for each part that the robot cannot grasp, with its size as it stands.

    Args:
        turns: Part -> its orientation, (3, 3).
    """
    for part, R in turns.items():
        if part in found.crowded:
            yield f"the gripper has no room to hold '{part}' from above; let it stand out higher, or give it a handle"
        if found.grasps[part] is None:
            size = " x ".join(f"{1e3 * np.ptp(measure_extent(solids[part].pieces, R[i])):.4g}" for i in range(3))
            yield f"'{part}', {size} mm as it stands, offers no place to a gripper from above"
