"""The environments for Gymnasium, and for `dm_env`."""

from typing import Any

import gymnasium

from apo_bench.arguments import check_arguments
from apo_bench.errors import missing_package


@check_arguments
def to_dm_env(env: gymnasium.Env[Any, Any], *, seed: int | None = None) -> Any:
    """The environment as a `dm_env.Environment`.

    Args:
        env: As `gymnasium.make("APOReplay-v0")` made it.
        seed: Of the first episode; the others follow from it, as with `env.reset(seed=seed)` and `env.reset()`.

    Raises:
        InputError: The package dm-env is not installed.
    """
    try:
        from apo_bench.envs.dm_adapter import DmAdapter
    except ImportError as error:
        if error.name != "dm_env":
            raise
        raise missing_package("to_dm_env", "dm-env") from error
    return DmAdapter(env, seed)
