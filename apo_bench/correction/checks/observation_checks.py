"""What a corrector may be given: observations whose poses and numbers make sense, whoever made them."""

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, kind, require
from apo_bench.geometry import FARTHEST_M, Array, is_rigid

_ASYMMETRY = 1e-9
"""How far a covariance may be from symmetric, as a part of its largest entry."""


def check_observations(observations: Sequence[Any]) -> None:
    """Refuse what no corrector can make sense of, before any is asked, so that the blame falls where it belongs.

    Args:
        observations: One, or several of one assembly with the same start poses.

    Raises:
        InputError: One is no `Observation`, a pose is not rigid or absurdly far away, a part has no start, a covariance
            is not symmetric, or a length makes no sense.
    """
    for i, observation in enumerate(observations):
        require(
            isinstance(observation, Observation),
            f"an Observation is needed, {kind(observation)} was given; make one, or read it from a file.",
        )
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

    rows = [*map(first.start.__getitem__, parts), *(observation.goals.reshape(-1, 4) for observation in observations)]
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
    observation = observations[i]
    if (
        type(observation.gap_m) is type(observation.play_m) is float
        and 0.0 < observation.gap_m < inf
        and 0.0 <= observation.play_m < inf
    ):
        return
    for field, x, low in (("gap_m", observation.gap_m, "above"), ("play_m", observation.play_m, "from")):
        number = isinstance(x, float | int | np.floating | np.integer) and not isinstance(x, bool)
        if not number or not np.isfinite(x) or x < 0.0 or (low == "above" and x == 0.0):
            name = _name(observations, i)
            raise InputError(f"{name} states {field}={x!r}; a finite length {low} 0 is needed, in metres.")


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
    i, k = [(i, k) for i, observation in enumerate(observations) for k in range(len(observation.goals))][j]
    return f"operation {k + 1} in {_name(observations, i)}"


def _name(observations: Sequence[Any], i: int) -> str:
    return f"observation {i + 1}" if len(observations) > 1 else "the observation"
