"""What Gymnasium makes by `APOInsert-v0` and `APOAssemble-v0`: the environment within its time limit.

The environments end their episodes themselves, with a verdict. The limit of Gymnasium has the same length, whatever the
argument `horizon`, so that tools can read it and it never ends an episode without a verdict.
"""

from typing import Any

from gymnasium.wrappers import TimeLimit

from apo_bench.envs.apo_assemble import APOAssemble
from apo_bench.envs.apo_insert import APOInsert


def make_insert(*args: Any, **settings: Any) -> Any:
    """Make `APOInsert-v0`; arguments are those of `APOInsert`."""
    env = APOInsert(*args, **settings)
    return TimeLimit(env, env.most_actions)


def make_assemble(**settings: Any) -> Any:
    """Make `APOAssemble-v0`; arguments are those of `APOAssemble`."""
    env = APOAssemble(**settings)
    return TimeLimit(env, env.most_actions)


for _make in (make_insert, make_assemble):
    vars(_make)["metadata"] = APOInsert.metadata  # Gymnasium reads the render modes of an entry point
