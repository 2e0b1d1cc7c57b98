"""Validation of what a corrector gets, and of what a corrector from outside the package returns."""

from collections.abc import Sequence
from math import inf

import numpy as np

from apo_bench.assembly import SCHEDULE_REMEDY, Assembly, Correction, Observation, find_schedule_fault
from apo_bench.errors import InputError, require
from apo_bench.geometry import FARTHEST_M, Array, is_rigid
from apo_bench.io import UNSHOWN

_SAME = 1e-9
"""Difference, [m] and unitless, up to which two poses are the same."""
_ASYMMETRY = 1e-9
"""Largest asymmetry of a covariance, as a fraction of its largest entry."""


def check_observation(observation: Observation) -> None:
    """Reject an observation that no corrector can process.

    Raises:
        InputError: A pose is not rigid or absurdly far away, a part has no start, a covariance is not symmetric, or a
            length makes no sense.
    """
    check_observations((observation,), ("the observation",))


def check_observations(observations: Sequence[Observation], names: Sequence[str]) -> None:
    """Check several observations as `check_observation` does.

    Args:
        names: The name of each observation in error messages.

    Raises:
        InputError: As of one, with the name of the observation.
    """
    poses = list[Array]()
    pose_names = list[str]()
    operations = list[str]()
    for observation, called in zip(observations, names, strict=True):
        gap_m = observation.gap_m
        play_m = observation.play_m
        start = observation.start
        require(0.0 < gap_m < inf, f"{called} states gap_m={gap_m!r}; give a finite length above 0, in metres.")
        require(
            0.0 <= play_m < inf, f"{called} states play_m={play_m!r}; give a finite length of 0 or more, in metres."
        )
        for part in observation.assembly.solids:
            require(part in start, f"{called} has no start of the part '{part}'; state where every part starts.")
        own = [f"operation {k + 1} in {called}" for k in range(len(observation.poses))]
        poses += [*start.values(), *observation.poses]
        pose_names += [f"the start of '{part}' in {called}" for part in start]
        pose_names += [f"the pose of {operation}" for operation in own]
        operations += own
    check_poses(np.array(poses).reshape(-1, 4, 4), pose_names)
    C = np.concatenate([observation.covariance for observation in observations])
    off = np.abs(C - np.swapaxes(C, 1, 2)).max(axis=(1, 2), initial=0.0)
    for k in np.flatnonzero(off > _ASYMMETRY * np.abs(C).max(axis=(1, 2), initial=0.0)):
        raise InputError(f"the covariance of {operations[k]} is not symmetric; entry (i, j) must equal entry (j, i).")


def check_poses(T: Array, names: Sequence[str]) -> None:
    """Reject poses, (k, 4, 4), that are not rigid, or too far away to compute with.

    Raises:
        InputError: With the name of the first of them.
    """
    rigid = is_rigid(T)
    far = (np.abs(T[:, :3, 3]) > FARTHEST_M).any(axis=1)
    for j in map(int, np.flatnonzero(~rigid | far)):
        require(
            rigid[j],
            f"{names[j]} is not a rigid pose; give a rotation matrix, a position [m] and the last row (0, 0, 0, 1).",
        )
        raise InputError(
            f"{names[j]} has a position of {np.abs(T[j, :3, 3]).max():g} m; give numbers of at most {FARTHEST_M:g}, in "
            "metres."
        )


def check_correction(correction: Correction, assembly: Assembly, name: str) -> None:
    """Reject a correction by the corrector called `name` that cannot be executed or written into a record.

    Raises:
        InputError: The first thing that is wrong.
    """
    made = f"the corrector '{name}' returned"
    n = len(assembly)
    tried = [k for one in correction.tried for k in (one.step, *one.free)]
    for field, operations in (("freed", correction.freed), ("tried", tried)):
        for k in operations:
            require(0 <= k < n, f"{made} the operation {k} in `{field}`; return whole numbers from 0 to {n - 1}.")
    sentence = correction.sentence
    require(
        sentence.strip() and not UNSHOWN.search(sentence),
        f"{made} {sentence!r} as its sentence; return one line of plain text.",
    )
    for one in correction.dropped:
        known = not assembly.without((one,)).all()
        require(known, f"{made} {one!r} in `dropped`; return a tuple of relations, such as 'R1'.")
    wrong = find_schedule_fault(correction.schedule, n) if correction.schedule else ""
    require(not wrong, f"{made} a schedule that {wrong}; {SCHEDULE_REMEDY}.")
    if correction.step_poses is None:
        return
    require(correction.schedule, f"{made} step poses and no schedule; return one step for each of them, or neither.")
    steps = range(1, len(correction.schedule) + 1)
    check_poses(correction.step_poses, [f"the pose of step {i} that the corrector '{name}' returned" for i in steps])
    ends = {
        step.operation: T for step, T in zip(correction.schedule, correction.step_poses, strict=True) if not step.undo
    }
    for k, T in ends.items():
        require(
            np.abs(T - correction.poses[k]).max() <= _SAME,
            f"{made} a last step pose of operation {k + 1} that is not its pose; return poses that are in force at the "
            "end.",
        )
