"""Judge the finished assembly: what a person says who sees the end, whatever became of it on the way."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses, ReachedState, Relation, compute_placements
from apo_bench.geometry import Array, Overlap, find_nearest_alike
from apo_bench.judging.contacts import ContactJudge, Share, face_overlap
from apo_bench.judging.displaced import displacements, faults_of_place, last_moves
from apo_bench.judging.judgement import Judgement, judgement
from apo_bench.records import Thresholds


def judge_finished(
    assembly: Assembly, reached: ReachedState, reference: Array, thresholds: Thresholds, clearance_mm: float
) -> Judgement:
    """Judge the end: gaps, overlaps, penetration, nothing held, nothing moving, and parts as they were put together.

    The contacts that stand at the end are needed. A part may have been put in by any of its symmetries: the one
    nearest in rotation to its true final pose counts, for all its contacts. On a fixed part the area of the overlap
    counts, wherever it is, so that an assembly that is right in itself may stand elsewhere on the table; between
    movable parts the overlap has its place on the environment face. Where fixtures end is free. Parts that touch at the
    end have moved against each other by `pushed_mm` at most since they were put, at any corner and along what their
    contacts leave free; so has a part in a mate of a fixed part. Every operation must have ended.

    Args:
        reached: Sound snapshots.
        reference: (n, 4, 4), the true goals, world frame, [m].
    """
    final = reached.final
    all_made = all(snapshot is not None for snapshot in (*reached.after, reached.final))
    if final is None:
        return judgement((), (), (), thresholds, all_made=False)
    judge = ContactJudge(assembly, thresholds, clearance_mm)
    away = fixtures(assembly)
    true = compute_placements(assembly, final.poses, reference)[-1]
    seen = _as_meant(assembly, final.poses, true)
    return judgement(
        tuple(judge.verdict(contact, k, "end", seen, true, share) for contact, k, share in _standing(assembly, away)),
        [final],
        [(what, 1e3 * m) for what, m in faults_of_place(assembly, reached.after, final, away, seen)],
        thresholds,
        all_made=all_made,
        disturbed=[1e3 * m for _, m in displacements(assembly, reached.after, final, away)],
    )


def fixtures(assembly: Assembly) -> frozenset[str]:
    """The parts that were used and put away.

    The last operation of such a part breaks its last contacts with movable parts and makes contacts with fixed parts
    only. One that ends against a movable part is none, even if that part leaves it later.
    """
    relations = assembly.relations()
    return frozenset(part for part, k in last_moves(assembly).items() if _put_away(assembly, relations, part, k))


def _put_away(assembly: Assembly, relations: tuple[Relation, ...], part: str, k: int) -> bool:
    mine = [relation for relation in relations if part in {end.part for end in relation.contact}]
    movable = [relation for relation in mine if not _on_fixed(assembly, relation.contact)]
    breaks = any(relation.lost == k for relation in movable)
    makes = any(relation.made == k for relation in mine if relation not in movable)
    return breaks and makes and all(relation.lost is not None and relation.lost <= k for relation in movable)


def _on_fixed(assembly: Assembly, contact: Contact) -> bool:
    return any(end.part in assembly.fixed for end in contact)


def _standing(assembly: Assembly, away: frozenset[str]) -> Iterator[tuple[Contact, int, Share]]:
    """Contacts that stand at the end, of parts that are no fixtures; what made them, what of an overlap counts."""
    for contact, made, lost in assembly.relations():
        if lost is None and not away & {end.part for end in contact}:
            yield contact, made, _share_of_area if _on_fixed(assembly, contact) else Overlap.share


def least_overlaps(assembly: Assembly, final: Poses, references: Array) -> Array:
    """The least share of the true overlap that a finished assembly covers, for each of several truths, (d,).

    Args:
        references: (d, n, 4, 4), goals that may be the true ones, world frame, [m].

    Returns:
        Not a number where faces that should touch do not meet in the truth itself, so that it cannot be one.
    """
    contacts = tuple(_standing(assembly, fixtures(assembly)))
    return np.array(
        [_least_overlap(assembly, final, compute_placements(assembly, final, T)[-1], contacts) for T in references]
    )


def _least_overlap(
    assembly: Assembly, final: Poses, true: Poses, contacts: Sequence[tuple[Contact, int, Share]]
) -> float:
    seen = _as_meant(assembly, final, true)
    least = 1.0
    for contact, _, share in contacts:
        expected = face_overlap(assembly, contact, true)
        if not expected:
            return math.nan
        least = min(least, share(face_overlap(assembly, contact, seen), expected))
    return least


def _as_meant(assembly: Assembly, final: Poses, true: Poses) -> Poses:
    """Poses of parts turned by that of their symmetries which is nearest to the truth."""
    return {
        part: T if part in assembly.fixed else find_nearest_alike(assembly.solids[part], T, true[part])
        for part, T in final.items()
    }


def _share_of_area(reached: Overlap, true: Overlap) -> float:
    return min(1.0, reached.area / true.area) if true else 1.0
