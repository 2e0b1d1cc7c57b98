"""Evaluate a policy in `APOInsert-v0`: success and, where it fails, the reason."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from apo_bench.arguments import check_arguments
from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.policies import POLICIES, MakePolicy
from apo_bench.errors import InputError
from apo_bench.names import resolve

REASONS = ("never entered", "stopped inside", "moved parts", "out of time", "force")
"""Why an episode fails.

The part was never in the hole; it was, but the hand opened too early; it moved parts that stood in their places; time
ran out inside of the hole; force or a collision ended the episode.
"""
_ENTERED_MM = 1.0
_FORCED = ("force_stop", "collision", "lost_grasp", "unstable_simulation")


class EpisodeResult(NamedTuple):
    """The end of one episode."""

    trial: int
    """The number of its trial."""
    success: bool
    """The judge's verdict."""
    reason: str
    """One of `REASONS`; empty after a success."""
    code: str
    """The outcome code."""
    actions: int
    """Number of actions."""
    deepest_mm: float
    """Greatest true depth of the part in the hole."""
    peak_force_n: float
    """Greatest filtered force on the part."""


@check_arguments
def evaluate_policy(env: Any, policy: Any, trials: Iterable[int]) -> Iterator[EpisodeResult]:
    """Run one episode of each trial that reaches the operation.

    Args:
        env: An environment of `APOInsert-v0`, with or without wrappers; the policy gets the observations and gives the
            actions of the outermost one.
        policy: A name of `POLICIES`, `package.module:name`, or a function that takes the environment without wrappers
            after each reset and returns a function of the observation.
        trials: Their numbers; those for evaluation are below 100000.

    Yields:
        The results, in the order of the trials.

    Raises:
        InputError: Another environment, or there is no such policy.
    """
    base = getattr(env, "unwrapped", None)
    if not isinstance(base, APOInsert):
        raise InputError("env must be an environment of APOInsert-v0, with or without wrappers.")
    make: MakePolicy = resolve(policy, POLICIES, "policy")
    return _run(env, base, make, trials)


def _run(env: Any, base: APOInsert, make: MakePolicy, trials: Iterable[int]) -> Iterator[EpisodeResult]:
    """Yield the result of each trial that does not fail before the operation."""
    for trial in trials:
        try:
            observation, info = env.reset(options={"trial": trial})
        except InputError:
            continue
        act = make(base)
        deepest = force = 0.0
        actions = 0
        over = truncated = False
        while not over:
            observation, _, terminated, truncated, info = env.step(act(observation))
            over = terminated or truncated
            actions += 1
            deepest = max(deepest, info["depth_mm"])
            force = max(force, info["force_n"])
        success = bool(info["success"])
        reason = "" if success else find_reason(info, deepest, truncated)
        yield EpisodeResult(trial, success, reason, info["code"], actions, deepest, force)


def find_reason(info: dict[str, Any], deepest_mm: float, truncated: bool) -> str:
    """Return why an episode failed, one of `REASONS`.

    Args:
        info: That of its last step.
        deepest_mm: Greatest depth of the part in the hole.
        truncated: Whether its time ran out.
    """
    if info["code"] in _FORCED:
        return "force"
    if info["success_once"] or info["code"] == "pushed":
        return "moved parts"
    if deepest_mm < _ENTERED_MM:
        return "never entered"
    return "out of time" if truncated else "stopped inside"
