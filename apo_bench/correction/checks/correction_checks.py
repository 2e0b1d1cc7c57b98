"""What a corrector of somebody else's returned: whether it can be executed and written into a row."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from apo_bench.assembly import SCHEDULE_REMEDY, Assembly, Consistency, Correction, Step, Try, schedule_fault
from apo_bench.errors import InputError, require
from apo_bench.geometry import FARTHEST_M, Array, is_rigid
from apo_bench.io.plain_text import UNSHOWN

RIGID = "return a rotation matrix, a position [m] and the last row (0, 0, 0, 1)"
_SAME = 1e-9
"""Poses that differ by less, [m] and unitless, are one and the same."""


def check_correction(correction: Correction, assembly: Assembly, name: str) -> Correction:
    """The correction by the corrector called `name`, its schedule made of steps.

    Raises:
        InputError: The first thing that is wrong.
    """
    correction = replace(correction, schedule=_steps(correction.schedule, name))
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


def _steps(schedule: Any, name: str) -> tuple[Step, ...]:
    """The schedule as steps; pairs of a whole number and a truth value will do."""
    steps = []
    for i, stated in enumerate(schedule if isinstance(schedule, Sequence) else [schedule], start=1):
        pair = tuple(stated) if isinstance(stated, Sequence) and not isinstance(stated, str) else (stated,)
        k, undo = (*pair, False)[:2]
        if len(pair) not in (1, 2) or not _whole(k) or not isinstance(undo, bool | np.bool_):
            raise InputError(
                f"the corrector '{name}' returned {stated!r} as step {i} of its schedule; "
                "return `Step(operation, undo)`, the operation counted from 0."
            )
        steps.append(Step(int(k), bool(undo)))
    return tuple(steps)


def _check_numbers(correction: Correction, n: int, name: str) -> None:
    """What a row repeats: operations that exist, gaps that are numbers."""
    tried = correction.tried if isinstance(correction.tried, Sequence) else (correction.tried,)
    named = [("freed", k) for k in _listed(correction.freed)]
    for one in tried:
        if not isinstance(one, Try):
            raise InputError(f"the corrector '{name}' returned {one!r} among `tried`; return `Try(step, free, gap_m)`.")
        named += [("tried", k) for k in (one.step, *_listed(one.free))]
    for field, k in named:
        if not _whole(k) or not 0 <= k < n:
            raise InputError(
                f"the corrector '{name}' returned the operation {k!r} in `{field}`; "
                f"return whole numbers from 0 to {n - 1}."
            )
    gaps = [("gap_before_m", correction.gap_before_m), ("gap_after_m", correction.gap_after_m)]
    for field, gap_m in (*gaps, *(("gap_m of `tried`", one.gap_m) for one in tried)):
        if not isinstance(gap_m, float | int | np.floating):
            raise InputError(f"the corrector '{name}' returned {gap_m!r} as {field}; return a length in metres.")


def _check_words(correction: Correction, assembly: Assembly, name: str) -> None:
    """What a person reads: a sentence, tests, relations that there are."""
    sentence = correction.sentence
    if not isinstance(sentence, str) or not sentence.strip() or UNSHOWN.search(sentence):
        raise InputError(
            f"the corrector '{name}' returned {sentence!r} as its sentence; return one line of plain text."
        )
    for field, test in (("test", correction.test), ("test_after", correction.test_after)):
        if test is not None and not isinstance(test, Consistency):
            raise InputError(f"the corrector '{name}' returned {test!r} as `{field}`; return a Consistency or None.")
    for one in correction.dropped if isinstance(correction.dropped, tuple) else (correction.dropped,):
        if not isinstance(one, str) or assembly.without((one,)).all():
            raise InputError(
                f"the corrector '{name}' returned {one!r} in `dropped`; return a tuple of relations, such as 'R1'."
            )


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, Sequence) and not isinstance(value, str) else (value,)


def _whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _check_schedule(correction: Correction, name: str) -> None:
    if correction.schedule and (wrong := schedule_fault(correction.schedule, len(correction.goals))):
        raise InputError(f"the corrector '{name}' returned a schedule that {wrong}; {SCHEDULE_REMEDY}.")
    if correction.targets is None:
        return
    require(
        correction.schedule,
        f"the corrector '{name}' returned targets and no schedule; return one step per target, or no targets.",
    )
    for j in np.flatnonzero(~is_rigid(correction.targets)):
        raise InputError(
            f"the corrector '{name}' returned a target for step {j + 1} of its schedule that is not a rigid pose; "
            f"{RIGID}."
        )
    check_near(correction.targets, name, "a target for step")
    ends = {step.operation: i for i, step in enumerate(correction.schedule) if not step.undo}
    for k, i in ends.items():
        if np.abs(correction.targets[i] - correction.goals[k]).max() > _SAME:
            raise InputError(
                f"the corrector '{name}' returned a last target for operation {k + 1} that is not its goal; "
                "return goals that are the targets in force at the end."
            )
