"""Find the contacts of an assembly at given poses, and adjust the poses until all contacts are closed.

Poses of a file and fitted faces are rounded, so faces within 0.05 mm count as touching. Then all parts but the fixed
ones move by the least amount that closes every contact.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations, product

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    FacingPair,
    PartFace,
    Poses,
    classify_contact,
    compute_geometric_play,
)
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import Array, RoundFace, Solid, measure_intrusion, measure_mate, pose
from apo_bench.scenario.layout_checks import DEEP_M

NEAR_M = 5e-5  # largest gap of a contact at the given poses
NEAR_RAD = 2e-3  # largest angle between its faces
SHARE = 0.02  # smallest overlap, as a share of the smaller face
_CLOSED_M = 5e-7  # largest gap of a closed contact
_CLOSED_RAD = 1e-4  # largest angle of a closed contact
_ROUNDS = 8  # Gauss-Newton iterations
_ARM_M = 0.05
"""Lever arm that converts rotations to lengths."""
NO_PLAY_MM = 1e-3  # a shaft and a hole have no play if theirs is at most this
COAXIAL_M = 1e-4  # largest offset of the axes of a shaft in its hole
_THREAD_M = 2.5e-3
"""A shaft up to this much larger in radius than its hole is a press fit or a thread; beyond it, another feature."""


def find_contacts(solids: Mapping[str, Solid], poses: Poses, gap_m: float = NEAR_M) -> tuple[Contact, ...]:
    """Return the pairs of faces of different parts whose gap is at most `gap_m`, in the order of the parts."""
    return tuple(
        Contact(PartFace(a, each.a), PartFace(b, each.b))
        for a, b in combinations(solids, 2)
        for each in find_facing_pairs(
            solids[a], poses[a], solids[b], poses[b], gap_m=gap_m, angle_rad=NEAR_RAD, share=SHARE
        )
    )


def close_contacts(
    solids: Mapping[str, Solid], poses: Poses, contacts: Iterable[Contact], fixed: Iterable[str]
) -> tuple[Poses, tuple[Contact, ...], tuple[Contact, ...]]:
    """Close contacts by small motions of the parts that are not fixed.

    Returns:
        The poses at which contacts are closed, the contacts that are closed, and those that contradict them.
    """
    kept = list(contacts)
    dropped = list[Contact]()
    free = [part for part in solids if part not in set(fixed)]
    while True:
        solved = _solve_poses(solids, poses, kept, free)
        off = [_measure_openness(solids, solved, contact) for contact in kept]
        if not kept or max(off) <= 1.0:
            return solved, tuple(kept), tuple(dropped)
        # Contacts contradict each other: drop the one with the largest residual, and solve again.
        dropped.append(kept.pop(int(np.argmax(off))))


def find_clashes(solids: Mapping[str, Solid], poses: Poses, clearance_mm: float) -> list[str]:
    """Return a sentence for each pair of parts that overlap, press fits and threads included.

    Args:
        clearance_mm: Clearance per side of faces marked as fit.
    """
    sentences = list[str]()
    for a, b in combinations(solids, 2):
        deep_m = measure_intrusion(solids[a], poses[a], solids[b], poses[b])
        tight = _find_tight_fit(solids, poses, (a, b), clearance_mm, deep_m)
        if tight:
            sentences.append(tight)
        elif deep_m > DEEP_M:
            sentences.append(f"'{a}' and '{b}' are {1e3 * deep_m:.3g} mm inside each other; give them room")
    return sentences


def find_walls_without_play(
    solids: Mapping[str, Solid], poses: Poses, contacts: Iterable[Contact]
) -> tuple[tuple[Contact, Contact], ...]:
    """Return pairs of contacts at opposite flat walls that enclose a part without play, none marked as fit."""
    flat = [c for c in contacts if all(of.face in solids[of.part].faces for of in c)]  # flat on flat only
    firm = [c for c in flat if not any(solids[of.part].faces[of.face].fit for of in c)]
    return tuple(
        (contact, opposite)
        for contact, opposite in combinations(firm, 2)
        if {of.part for of in contact} == {of.part for of in opposite}
        and _contact_normal(solids, poses, contact) @ _contact_normal(solids, poses, opposite) < -1.0 + 1e-6
    )


def _contact_normal(solids: Mapping[str, Solid], poses: Poses, contact: Contact) -> Array:
    """Return the normal of one face of a contact, (3,), world: of the part whose name sorts first."""
    of = min(contact)
    return np.asarray(poses[of.part][:3, :3] @ solids[of.part].faces[of.face].normal)


def _find_tight_fit(
    solids: Mapping[str, Solid], poses: Poses, pair: tuple[str, str], clearance_mm: float, deep_m: float
) -> str:
    """Return a sentence about a shaft without play in its hole, for a pair of parts; empty if there is none.

    Args:
        clearance_mm: Added to the play of faces marked as fit.
        deep_m: Depth of the overlap of the two parts; a shaft thicker than its hole by more than this ends before it.
    """
    a, b = pair
    for wall, other, play_m in find_coaxial_pairs(solids[a], poses[a], solids[b], poses[b]):
        play_mm = 1e3 * play_m + clearance_mm * (wall.fit or other.fit)
        if play_mm <= NO_PLAY_MM and play_m >= -min(_THREAD_M, deep_m + NEAR_M):
            return (
                f"'{a}.{wall.name}' and '{b}.{other.name}' have radii of {1e3 * wall.radius:.4g} and "
                f"{1e3 * other.radius:.4g} mm: a press fit or a thread, which no trial makes; leave the screw out, "
                f"allow an overlap of {-1e3 * play_m:.2g} mm, or make the hole wider"
            )
    return ""


def find_coaxial_pairs(
    a: Solid, T_a: Array, b: Solid, T_b: Array, most_off_m: float = COAXIAL_M
) -> Iterator[tuple[RoundFace, RoundFace, float]]:
    """Yield each shaft of one solid on the axis of a hole of the other, face of `a` first, and the radius of the hole
    minus that of the shaft, [m].

    Args:
        most_off_m: Largest distance of the axes.
    """
    for wall, other in product(a.rounds.values(), b.rounds.values()):
        if classify_contact(wall, other) != "shaft in hole":
            continue
        fit = measure_mate(wall, T_a, other, T_b)
        if fit.gap_m < most_off_m and fit.angle_rad < NEAR_RAD and fit.length_m > 1e-4:
            yield wall, other, compute_geometric_play(wall, other)


def _solve_poses(solids: Mapping[str, Solid], poses: Poses, contacts: list[Contact], free: list[str]) -> Poses:
    """Return poses at which all contacts are closed, by Gauss-Newton steps of least motion.

    Args:
        contacts: Their residuals are the equations.
        free: Parts that move; a twist of each is an unknown.
    """
    now = {part: np.array(T) for part, T in poses.items()}
    first = {part: 6 * i for i, part in enumerate(free)}  # part -> its first column
    for _ in range(_ROUNDS):
        # Rows J and values e of all residuals; tilts are multiplied by the lever arm, so that all are lengths. A twist
        # of part a changes a residual as the opposite twist of part b does, hence the signs.
        rows = list[Array]()
        values = list[Array]()
        for contact in contacts:
            each = _find_pair(solids, now, contact)
            if each is None:
                continue
            scale = np.where(np.arange(len(each.residual)) < each.lengths, 1.0, _ARM_M)
            block = np.zeros((len(scale), 6 * len(free)))
            for of, sign in zip(contact, (1.0, -1.0), strict=True):
                if of.part in first:
                    block[:, first[of.part] : first[of.part] + 6] += sign * scale[:, None] * each.slope
            rows.append(block)
            values.append(scale * each.residual)
        if not rows or np.abs(np.concatenate(values)).max() < 1e-12:
            break
        # The least |x / W| with J x = -e: x = W y, y the least solution of (J W) y = -e.
        W = np.tile([1.0, 1.0, 1.0, 1 / _ARM_M, 1 / _ARM_M, 1 / _ARM_M], len(free))
        try:
            x = W * np.linalg.lstsq(np.concatenate(rows) * W, -np.concatenate(values), rcond=1e-9)[0]
        except np.linalg.LinAlgError:  # `close_contacts` drops a contact then
            break
        for part, at in first.items():
            now[part] = pose.exp(x[at : at + 6]) @ now[part]
    return now


def _find_pair(solids: Mapping[str, Solid], poses: Poses, contact: Contact) -> FacingPair | None:
    """Return gap, angle and residuals of the two faces of a contact; None if the faces do not overlap.

    Limits are wider than those of a contact, since contacts open while others are closed.
    """
    a, b = contact
    pairs = find_facing_pairs(
        solids[a.part],
        poses[a.part],
        solids[b.part],
        poses[b.part],
        gap_m=10 * NEAR_M,
        angle_rad=10 * NEAR_RAD,
        share=SHARE / 2,
    )
    return next((pair for pair in pairs if (pair.a, pair.b) == (a.face, b.face)), None)


def _measure_openness(solids: Mapping[str, Solid], poses: Poses, contact: Contact) -> float:
    """Return how far a contact is from closed: at most 1 if closed, inf if the faces do not overlap."""
    each = _find_pair(solids, poses, contact)
    if each is None:
        return np.inf
    # The angle of a cone on a rim is free.
    is_on_rim = classify_contact(*map(Assembly(solids, (), frozenset()).face_of, contact)) == "cone on rim"
    return max(abs(each.gap_m) / _CLOSED_M, 0.0 if is_on_rim else each.angle_rad / _CLOSED_RAD)
