"""Judge the finished assembly: what a person says who sees the end, whatever became of it on the way."""

from collections.abc import Iterator, Mapping

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    Meetings,
    Poses,
    ReachedState,
    Relation,
    compute_placements,
    list_alternatives,
)
from apo_bench.geometry import Array, find_nearest_alike, remember
from apo_bench.judging.contacts import ContactCase, ContactJudge, compute_covered_shares
from apo_bench.judging.displaced import faults_of_place, last_moves
from apo_bench.judging.judgement import Judgement, judgement


def judge_finished(
    judge: ContactJudge, reached: ReachedState, reference: Array, displaced: Mapping[str, float]
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
        displaced: From `displacements`, [m].
    """
    assembly = judge.known.assembly
    final = reached.final
    all_made = all(snapshot is not None for snapshot in (*reached.after, reached.final))
    if final is None:
        return judgement((), (), (), judge.thresholds, all_made=False)
    away = fixtures(assembly)
    limits = judge.thresholds
    true = compute_placements(assembly, final.poses, reference)[-1]
    seen = _as_meant(assembly, final.poses, true)
    moved = faults_of_place(judge.known, reached.after, final, displaced, away, seen, limits.placed_part_shift_mm)
    return judgement(
        judge.verdicts([ContactCase(c, k, "end", seen, true, fixed) for c, k, fixed in _standing(assembly, away)]),
        [final],
        [(what, 1e3 * m) for what, m in moved],
        limits,
        all_made=all_made,
        disturbed=[1e3 * m for m in displaced.values()],
    )


@remember
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


def _standing(assembly: Assembly, away: frozenset[str]) -> Iterator[tuple[Contact, int, bool]]:
    """Contacts that stand at the end, of parts that are no fixtures; what made them, whether they may be anywhere."""
    for contact, made, lost in assembly.relations():
        if lost is None and not away & {end.part for end in contact}:
            yield contact, made, _on_fixed(assembly, contact)


def least_overlaps(assembly: Assembly, final: Poses, references: Array) -> Array:
    """The least share of the true overlap that a finished assembly covers, for each of several truths, (d,).

    Args:
        references: (d, n, 4, 4), goals that may be the true ones, world frame, [m].

    Returns:
        Not a number where faces that should touch do not meet in the truth itself, so that it cannot be one.
    """
    contacts = [(contact, anywhere) for contact, _, anywhere in _standing(assembly, fixtures(assembly))]
    true = compute_placements(assembly, final, references.swapaxes(0, 1))[-1]
    seen = _as_meant(assembly, final, true)
    count = len(references)
    common = Meetings(assembly).measure_overlaps(
        ((c, at) for each in (seen, true) for at in list_alternatives(each) for c, _ in contacts),
    )
    reached, expected = common[: len(common) // 2], common[len(common) // 2 :]
    covered = compute_covered_shares(reached, expected, [anywhere for _, anywhere in contacts] * count)
    covered[[not overlap for overlap in expected]] = np.nan
    return np.asarray(covered.reshape(count, -1).min(axis=1, initial=1.0))


def _as_meant(assembly: Assembly, poses: Poses, true: Poses) -> Poses:
    """Poses of parts turned by that of their symmetries which is nearest to the truth, or to each of several truths."""
    return {
        part: T if part in assembly.fixed else find_nearest_alike(assembly.solids[part], T, true[part])
        for part, T in poses.items()
    }
