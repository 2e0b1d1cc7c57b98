"""Judge the finished assembly by its final state alone, whatever happened during the assembly."""

from collections.abc import Iterator, Mapping

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactMeasurements,
    Poses,
    ReachedState,
    Relation,
    compute_placements,
    list_alternatives,
)
from apo_bench.geometry import Array, find_nearest_equivalent_pose, remember
from apo_bench.judging.contact_limits import ContactCase, ContactJudge, compute_covered_shares
from apo_bench.judging.judgement import Judgement, make_judgement
from apo_bench.judging.part_displacement import find_displaced_pairs, list_last_moves


def judge_finished(
    judge: ContactJudge, reached: ReachedState, reference: Array, displaced: Mapping[str, float]
) -> Judgement:
    """Judge the final state: contacts, penetration, nothing held, nothing moving, and no part displaced after placing.

    Only contacts that exist at the end are required. For each part, its symmetry nearest in rotation to the true final
    pose counts, for all of its contacts. With a fixed part only the area of the overlap counts, so an assembly that is
    right in itself may stand elsewhere on the table. Between movable parts the overlap has its place on the environment
    face. Fixtures may end anywhere. Displacements by `find_displaced_pairs` are at most `placed_part_shift_mm`. Every
    operation must have ended.

    Args:
        reached: Snapshots with finite poses.
        reference: (n, 4, 4), the true target poses, world frame, [m].
        displaced: From `measure_displacements`, [m].
    """
    assembly = judge.known.assembly
    final = reached.final
    all_made = all(snapshot is not None for snapshot in (*reached.after, reached.final))
    if final is None:
        return make_judgement((), (), (), judge.thresholds, all_made=False)
    away = list_fixtures(assembly)
    limits = judge.thresholds
    true = compute_placements(assembly, final.poses, reference)[-1]
    seen = _resolve_symmetries(assembly, final.poses, true)
    moved = find_displaced_pairs(judge.known, reached.after, final, displaced, away, seen, limits.placed_part_shift_mm)
    return make_judgement(
        judge.verdicts(
            [ContactCase(c, k, "end", seen, true, fixed) for c, k, fixed in _list_required_contacts(assembly, away)]
        ),
        [final],
        [(what, 1e3 * m) for what, m in moved],
        limits,
        all_made=all_made,
        disturbed=[1e3 * m for m in displaced.values()],
    )


@remember
def list_fixtures(assembly: Assembly) -> frozenset[str]:
    """The fixtures of an assembly: parts that were used and then put away.

    The last operation of a fixture breaks its last contacts with movable parts and makes contacts with fixed parts
    only. A part that ends against a movable part is no fixture, even if that part leaves later.
    """
    relations = assembly.relations()
    return frozenset(
        part for part, k in list_last_moves(assembly).items() if _is_put_away(assembly, relations, part, k)
    )


def _is_put_away(assembly: Assembly, relations: tuple[Relation, ...], part: str, k: int) -> bool:
    """Whether operation k, the last of a part, puts that part away."""
    # contacts of the part
    mine = [relation for relation in relations if part in {end.part for end in relation.contact}]
    movable = [relation for relation in mine if not _is_with_fixed_part(assembly, relation.contact)]
    breaks = any(relation.lost == k for relation in movable)
    makes = any(relation.made == k for relation in mine if relation not in movable)
    return breaks and makes and all(relation.lost is not None and relation.lost <= k for relation in movable)


def _is_with_fixed_part(assembly: Assembly, contact: Contact) -> bool:
    """Whether a contact is with a fixed part."""
    return any(end.part in assembly.fixed for end in contact)


def _list_required_contacts(assembly: Assembly, away: frozenset[str]) -> Iterator[tuple[Contact, int, bool]]:
    """The contacts that are required at the end, without those of fixtures.

    Yields (contact, operation that made it, whether its position on the environment face is free).
    """
    for contact, made, lost in assembly.relations():
        if lost is None and not away & {end.part for end in contact}:
            yield contact, made, _is_with_fixed_part(assembly, contact)


def compute_least_overlaps(assembly: Assembly, final: Poses, references: Array) -> Array:
    """The least covered share of a true overlap in a finished assembly, for each of d possible truths, (d,).

    Args:
        final: Poses of all parts in the finished assembly.
        references: (d, n, 4, 4), possible true target poses, world frame, [m].

    Returns:
        Not a number if required faces do not meet in the truth itself, which is then impossible.
    """
    contacts = [
        (contact, anywhere) for contact, _, anywhere in _list_required_contacts(assembly, list_fixtures(assembly))
    ]
    true = compute_placements(assembly, final, references.swapaxes(0, 1))[-1]
    seen = _resolve_symmetries(assembly, final, true)
    count = len(references)
    common = ContactMeasurements(assembly).measure_overlaps(
        ((c, at) for each in (seen, true) for at in list_alternatives(each) for c, _ in contacts),
    )
    # first half: at `seen`, second half: at `true`
    reached, expected = common[: len(common) // 2], common[len(common) // 2 :]
    covered = compute_covered_shares(reached, expected, [anywhere for _, anywhere in contacts] * count)
    covered[[not overlap for overlap in expected]] = np.nan  # the truth itself has no overlap
    return np.asarray(covered.reshape(count, -1).min(axis=1, initial=1.0))


def _resolve_symmetries(assembly: Assembly, poses: Poses, true: Poses) -> Poses:
    """Poses with each part rotated by its symmetry that is nearest to the truth, or to each of several truths."""
    return {
        part: T if part in assembly.fixed else find_nearest_equivalent_pose(assembly.solids[part], T, true[part])
        for part, T in poses.items()
    }
