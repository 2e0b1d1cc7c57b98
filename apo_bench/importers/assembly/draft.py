"""Posed parts become a draft of a scenario: contacts, an order, starts, grasps, and what is to be said of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.errors import InputError, unknown
from apo_bench.geometry import Array, Solid, extent, pose
from apo_bench.importers.assembly.holding import Holds, found_holds
from apo_bench.importers.assembly.nests import FLOOR_M, RAISED_M, nest_of
from apo_bench.importers.assembly.ordering import OrderSearch, Placing
from apo_bench.importers.assembly.posed import TABLE, PosedPart
from apo_bench.importers.assembly.touching import PLAY_M, clashes, closed, found_contacts, walls_without_play
from apo_bench.importers.assembly.waiting import Stance, laid_out, reach_of, site_of, stance
from apo_bench.importers.cad.solids.naming import free_name
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.scenario import Grasp, Site

_OPENING_M = 0.046
"""How far each finger of the arm that comes with the benchmark opens."""
_LOW_M = 1e-4
_GROUP_ROOM_M = 0.05
_FARTHEST_ASIDE_M = 0.26


@final
@dataclass(frozen=True, eq=False)
class Draft:
    """A scenario, before it is written."""

    parts: tuple[PosedPart, ...]
    """At the poses at which all contacts are closed."""
    fixed: tuple[str, ...]
    why_fixed: str
    order: tuple[Placing, ...]
    starts: Mapping[str, Array]
    """(4, 4), world, [m]; of fixed parts in the frame of the assembly. Of nests too."""
    stances: Mapping[str, Stance]
    nests: Mapping[str, Solid]
    """Part -> what it waits in, as it does not stand alone."""
    grasps: Mapping[str, Grasp | None]
    site: Site
    clearance_mm: float
    notes: tuple[str, ...]
    """What a person should know, one sentence each."""
    unfit: tuple[str, ...]
    """Those of them that say why the robot cannot do a part: there is no place to hold it, or none with room."""
    up: str = "z"
    """Which axis of the poses that were given looks up, and why, in words."""


class NoOrder(RuntimeError):
    """Parts cannot be put together one after the other, with this side up."""


def draft(
    parts: Sequence[PosedPart],
    fixed: Sequence[str] = (),
    clearance_mm: float = 0.25,
    asked: Sequence[str] = (),
    *,
    turned: bool = False,
) -> Draft:
    """Make a scenario of parts that stand on the table as `on_the_table` puts them.

    Args:
        fixed: Parts that stay where they are; none: the largest of those that lie lowest.
        clearance_mm: Room per side of faces that their part files mark as fit.
        asked: The parts that are moved, in the order in which they are put; none: any order.
        turned: Whether they stand as they shall; else they may be turned by quarters about the vertical, so that a hand
            that has to be tilted leans towards its arm.

    Raises:
        InputError: No part has that name, there is no room on the table, or they cannot be put in the order asked for.
        RuntimeError: Parts are inside each other.
        NoOrder: There is no order in which they can be put together.
    """
    solids = {each.name: each.solid for each in parts} | {TABLE: load_part(TABLE)}
    poses: Poses = {each.name: each.T for each in parts} | {TABLE: np.eye(4)}
    for name in fixed:
        if name not in solids or name == TABLE:
            raise InputError(unknown("part", name, [each.name for each in parts]))
    base, why_fixed = (
        (tuple(fixed), "as asked") if fixed else (lowest(parts)[:1], "the largest of those that lie lowest")
    )
    wrong = clashes(solids, poses, clearance_mm)
    if wrong:
        raise RuntimeError("; ".join(wrong) + ".")
    poses, contacts, dropped = closed(solids, poses, found_contacts(solids, poses), (TABLE, *base))
    notes = [
        *(f"'{contact}' touches, but not exactly where the other contacts put it: left out" for contact in dropped),
        *(
            f"'{contact}' and '{opposite}' leave no play between them; give their part room, or say fit = true of its "
            "faces"
            for contact, opposite in walls_without_play(solids, poses, contacts)
        ),
    ]
    apart = set(found_contacts(solids, poses, PLAY_M)) - {*contacts, *dropped}
    notes += [
        f"'{contact}' and '{opposite}' have play as drawn, so they are no contacts and correct nothing; draw them line "
        "to line, and they touch, and get their play from --loosen; or alike in all pairs, with the part in the middle"
        for contact, opposite in walls_without_play(solids, poses, sorted(apart))
    ]
    reach = reach_of(solids, poses, [each.name for each in parts])
    aside = np.array([-min(2.0 * reach + _GROUP_ROOM_M, _FARTHEST_ASIDE_M), 0.0, 0.0])
    search = OrderSearch(solids, poses, contacts, aside, asked=asked)
    order = search.order(frozenset(base))
    if order is None:
        raise NoOrder("; ".join(["there is no order in which these parts can be put together", *search.stuck()]) + ".")
    mains = [placing.moves[0] for placing in order]
    if asked and mains != list(asked):
        raise InputError(
            f"in the order {', '.join(asked)} these parts cannot be put together; {', '.join(mains)} can be: name "
            "every part once that is not fixed, what is put into another one behind it."
        )
    # Where assemblies may stand is kept free: the assembly, and a sub-assembly that is put together beside it.
    is_beside = any(np.linalg.norm(placing.at - poses[placing.moves[0]]) > _LOW_M for placing in order)
    site = site_of(reach, is_beside)
    middles = [site.center_m, site.center_m + aside[:2]] if is_beside else [site.center_m]
    keep_free = [(np.array(middle), reach + max(site.spread_m)) for middle in middles]
    turns = {each.name: poses[each.name][:3, :3] for each in parts if each.name not in base}
    stances = {part: stance(solids[part], R) for part, R in turns.items()}
    starts = {part: np.array(poses[part]) for part in (*base, *turns)}
    for part, at in laid_out(solids, turns, keep_free).items():
        starts[part][:3, 3] = (*at, stances[part].height_m)

    def held(floors_m: Mapping[str, float]) -> tuple[dict[str, Solid], dict[str, Array], Holds]:
        """Nests, starts and grasps, with some parts in nests that are so high."""
        nests = {p: nest_of(free_name(f"nest_{p}", solids), solids[p], turns[p], f) for p, f in floors_m.items()}
        raised = {p: pose.at((0.0, 0.0, f)) @ starts[p] for p, f in floors_m.items()}
        there = {**starts, **raised, **{nest.name: pose.at((*starts[p][:2, 3], 0.0)) for p, nest in nests.items()}}
        return nests, there, found_holds(solids, poses, there, nests, order, base, site)

    floors_m = {part: FLOOR_M for part in turns if not stances[part].stands}
    nests, there, found = held(floors_m)
    if found.crowded:  # a hand that is tilted wants room below what waits
        higher = held(floors_m | dict.fromkeys(found.crowded, RAISED_M))[2]
        if helped := found.crowded - higher.crowded:
            nests, there, found = held(floors_m | dict.fromkeys(helped, RAISED_M))
    quarters = 0 if turned else _quarters(poses, found)
    if quarters:
        T = pose.at(np.zeros(3), (0.0, 0.0, 90.0 * quarters))
        return draft([replace(each, T=T @ each.T) for each in parts], fixed, clearance_mm, asked, turned=True)
    unfit = tuple(_unfit(solids, turns, found))
    return Draft(
        tuple(replace(each, T=poses[each.name]) for each in parts),
        base,
        why_fixed,
        order,
        there,
        stances,
        nests,
        found.grasps,
        site,
        clearance_mm,
        (*notes, *unfit, *_waiting(stances, nests)),
        unfit,
    )


def _quarters(poses: Poses, found: Holds) -> int:
    """By how many quarters to turn so that the fingers of the first tilted hand point away from the arm, along x."""
    tilted = ((part, grasp.ahead) for part, grasp in found.grasps.items() if grasp and grasp.ahead is not None)
    for part, ahead in tilted:
        x, y, _ = poses[part][:3, :3] @ ahead
        return round(-np.arctan2(y, x) / (np.pi / 2)) % 4
    return 0


def lowest(parts: Sequence[PosedPart]) -> tuple[str, ...]:
    """The parts that lie on the table, the largest first."""
    low = {each.name: extent(each.solid.pieces, each.T[2, :3])[0] + float(each.T[2, 3]) for each in parts}
    lie = [each for each in parts if low[each.name] < min(low.values()) + _LOW_M]
    return tuple(each.name for each in sorted(lie, key=lambda each: -each.solid.volume))


def _waiting(stances: Mapping[str, Stance], nests: Mapping[str, Solid]) -> Iterator[str]:
    """What is to be said of parts that wait in nests, or may roll."""
    for part, how in stances.items():
        if part in nests:
            why = "a tilted hand wants room below it" if how.stands else "it does not stand on the table so"
            yield f"'{part}' waits in a nest made for it: {why}"
        elif how.rolls:
            yield f"'{part}' lies on a round wall at its start and may roll"


def _unfit(solids: Mapping[str, Solid], turns: Mapping[str, Array], found: Holds) -> Iterator[str]:
    """What is to be said of parts that cannot be held."""
    for part, R in turns.items():
        if part in found.crowded:
            yield (
                f"wherever a gripper holds '{part}', from above or tilted, it meets what stands around its place or "
                "its start; let it stand out higher, or give it a handle"
            )
        if found.grasps[part] is None:
            size = " x ".join(f"{1e3 * np.ptp(extent(solids[part].pieces, R[i])):.4g}" for i in range(3))
            yield (
                f"'{part}', {size} mm as it stands, offers no place to a gripper from above that opens to "
                f"{2e3 * _OPENING_M:g} mm"
            )
