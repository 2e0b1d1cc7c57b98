"""What a corrector of somebody else's returned: whether it can be executed and written into a row.

What a corrector may be given: observations whose poses and numbers make sense, whoever made them.
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import numpy as np

from apo_bench.assembly import (
    SCHEDULE_REMEDY,
    Assembly,
    Correction,
    Observation,
    schedule_fault,
)
from apo_bench.errors import InputError, require
from apo_bench.geometry import FARTHEST_M, Array, is_rigid
from apo_bench.io import UNSHOWN

RIGID = "return a rotation matrix, a position [m] and the last row (0, 0, 0, 1)"
_SAME = 1e-9
"""Poses that differ by less, [m] and unitless, are one and the same."""


def check_correction(correction: Correction, assembly: Assembly, name: str) -> Correction:
    """The correction by the corrector called `name`.

    Raises:
        InputError: The first thing that is wrong.
    """
    _check_numbers(correction, len(assembly), name)
    _check_words(correction, assembly, name)
    _check_schedule(correction, name)
    return correction


def check_near(T: Array, name: str, what: str) -> None:
    """Refuse poses, (k, 4, 4), so far away that nothing can be computed with them.

    Args:
        what: What they are, before a number from 1: `a goal for operation`.
    """
    for k in np.flatnonzero(np.isfinite(T).all(axis=(1, 2)) & (np.abs(T[:, :3, 3]) > FARTHEST_M).any(axis=1)):
        raise InputError(
            f"the corrector '{name}' returned {what} {k + 1} with a position of {np.abs(T[k, :3, 3]).max():g} m; "
            f"return numbers of at most {FARTHEST_M:g}, in metres."
        )


def _check_numbers(correction: Correction, n: int, name: str) -> None:
    """What a row repeats: operations that exist."""
    named = [("freed", k) for k in correction.freed]
    named += [("tried", k) for one in correction.tried for k in (one.step, *one.free)]
    for field, k in named:
        require(
            0 <= k < n,
            f"the corrector '{name}' returned the operation {k} in `{field}`; return whole numbers from 0 to {n - 1}.",
        )


def _check_words(correction: Correction, assembly: Assembly, name: str) -> None:
    """What a person reads: a sentence, relations that there are."""
    sentence = correction.sentence
    if not sentence.strip() or UNSHOWN.search(sentence):
        raise InputError(
            f"the corrector '{name}' returned {sentence!r} as its sentence; return one line of plain text."
        )
    for one in correction.dropped:
        if assembly.without((one,)).all():
            raise InputError(
                f"the corrector '{name}' returned {one!r} in `dropped`; return a tuple of relations, such as 'R1'."
            )


def _check_schedule(correction: Correction, name: str) -> None:
    if correction.schedule and (wrong := schedule_fault(correction.schedule, len(correction.poses))):
        raise InputError(f"the corrector '{name}' returned a schedule that {wrong}; {SCHEDULE_REMEDY}.")
    if correction.step_poses is None:
        return
    require(
        correction.schedule,
        f"the corrector '{name}' returned targets and no schedule; return one step per target, or no targets.",
    )
    for j in np.flatnonzero(~is_rigid(correction.step_poses)):
        raise InputError(
            f"the corrector '{name}' returned a target for step {j + 1} of its schedule that is not a rigid pose; "
            f"{RIGID}."
        )
    check_near(correction.step_poses, name, "a target for step")
    ends = {step.operation: i for i, step in enumerate(correction.schedule) if not step.undo}
    for k, i in ends.items():
        if np.abs(correction.step_poses[i] - correction.poses[k]).max() > _SAME:
            raise InputError(
                f"the corrector '{name}' returned a last target for operation {k + 1} that is not its goal; "
                "return goals that are the targets in force at the end."
            )


_ASYMMETRY = 1e-9
"""How far a covariance may be from symmetric, as a part of its largest entry."""


def check_observations(observations: Sequence[Observation]) -> None:
    """Refuse what no corrector can make sense of, before any is asked, so that the blame falls where it belongs.

    Args:
        observations: One, or several of one assembly with the same start poses.

    Raises:
        InputError: A pose is not rigid or absurdly far away, a part has no start, a covariance
            is not symmetric, or a length makes no sense.
    """
    for i in range(len(observations)):
        _check_lengths(observations, i)
    if not observations:
        return
    first = observations[0]
    for part in first.assembly.solids:
        require(
            part in first.start,
            f"{_name(observations, 0)} has no start of the part '{part}'; state where every part starts.",
        )
    parts = list(first.assembly.solids)

    def name(j: int) -> str:
        if j < len(parts):
            return f"the start of '{parts[j]}' in {_name(observations, 0)}"
        return f"the goal of {_operation(observations, j - len(parts))}"

    rows = [*map(first.start.__getitem__, parts), *(observation.poses.reshape(-1, 4) for observation in observations)]
    _check_poses(np.concatenate(rows).reshape(-1, 4, 4), name)
    C = np.concatenate([observation.covariance for observation in observations])
    off = C - np.swapaxes(C, 1, 2)
    if not off.any():
        return
    lopsided = np.abs(off).max(axis=(1, 2), initial=0.0) > _ASYMMETRY * np.abs(C).max(axis=(1, 2), initial=0.0)
    for j in map(int, np.flatnonzero(lopsided)):
        raise InputError(
            f"the covariance of {_operation(observations, j)} is not symmetric; entry (i, j) must equal entry (j, i)."
        )


def _check_lengths(observations: Sequence[Observation], i: int) -> None:
    gap_m = observations[i].gap_m
    play_m = observations[i].play_m
    name = _name(observations, i)
    require(0.0 < gap_m < inf, f"{name} states gap_m={gap_m!r}; a finite length above 0 is needed, in metres.")
    require(0.0 <= play_m < inf, f"{name} states play_m={play_m!r}; a finite length from 0 is needed, in metres.")


def _check_poses(T: Array, name: Callable[[int], str]) -> None:
    """Poses (p, 4, 4); `name` says which one is number j."""
    rigid = is_rigid(T)
    far = (np.abs(T[:, :3, 3]) > FARTHEST_M).any(axis=1)
    if rigid.all() and not far.any():
        return
    for j in map(int, np.flatnonzero(~rigid)):
        raise InputError(
            f"{name(j)} is not a rigid pose; give a rotation matrix, a position [m] and the last row (0, 0, 0, 1)."
        )
    for j in map(int, np.flatnonzero(far)):
        raise InputError(
            f"{name(j)} has a position of {np.abs(T[j, :3, 3]).max():g} m; numbers of at most {FARTHEST_M:g} are "
            "allowed, so check the unit."
        )


def _operation(observations: Sequence[Observation], j: int) -> str:
    """Row j of all operations of all observations: `operation 2 in observation 3`."""
    i, k = [(i, k) for i, observation in enumerate(observations) for k in range(len(observation.poses))][j]
    return f"operation {k + 1} in {_name(observations, i)}"


def _name(observations: Sequence[Any], i: int) -> str:
    return f"observation {i + 1}" if len(observations) > 1 else "the observation"
