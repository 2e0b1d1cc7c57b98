"""A wrapper for libraries that need flat float32 observations and actions between -1 and 1."""

from typing import Any, final

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.envs.actions import read_action
from apo_bench.errors import InputError

Flat = NDArray[np.float32]


@final
@check_arguments
class Flatten(gymnasium.Wrapper[Flat, Flat, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """Flatten observations and actions of any environment of this package.

    Observations are one `Box` of float32, as `gymnasium.spaces.flatten` orders them. Actions are one `Box` of float32
    in [-1, 1]: the numbers of a `Box` are scaled to its bounds, and of the numbers of a `Discrete` the largest counts.

    Examples:
        >>> import apo_bench, gymnasium
        >>> env = apo_bench.Flatten(gymnasium.make("APOReplay-v0", scenario="block_on_block"))
        >>> env.action_space
        Box(-1.0, 1.0, (12,), float32)
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        """Wrap an environment.

        Raises:
            InputError: Its actions are neither a `Box` nor a `Dict` of `Box` and `Discrete`.
        """
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        seen = spaces.flatten_space(env.observation_space)
        assert isinstance(seen, spaces.Box)
        self.observation_space = self._seen = spaces.Box(
            seen.low.astype(np.float32), seen.high.astype(np.float32), dtype=np.float32
        )
        self._size = sum(map(_size, _parts(env.action_space).values()))  # numbers of a flat action
        self.action_space = spaces.Box(-1.0, 1.0, (self._size,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Flat, dict[str, Any]]:
        """Reset the environment; return the flat observation."""
        seen, info = self.env.reset(seed=seed, options=options)
        return self._flat(seen), info

    def step(self, action: Flat) -> tuple[Flat, float, bool, bool, dict[str, Any]]:
        """Take a flat action, with its numbers clipped to -1 and 1; return the flat observation.

        Raises:
            InputError: It is no array of so many finite numbers.
        """
        given = read_action(action, self._size)
        seen, reward, terminated, truncated, info = self.env.step(self._action(given))
        return self._flat(seen), float(reward), terminated, truncated, info

    def _flat(self, seen: Any) -> Flat:
        """Return the flat observation; clipping removes rounding beyond the bounds."""
        flat: Any = spaces.flatten(self.env.observation_space, seen)
        return np.clip(flat, self._seen.low, self._seen.high).astype(np.float32)

    def _action(self, given: Flat) -> Any:
        """Convert a flat action to one of the environment."""
        made: dict[str, Any] = {}
        for name, part in _parts(self.env.action_space).items():
            numbers, given = np.split(given, [_size(part)])
            made[name] = int(np.argmax(numbers)) if isinstance(part, spaces.Discrete) else _scale(part, numbers)
        return made if isinstance(self.env.action_space, spaces.Dict) else made[""]


def _parts(space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    """Return the parts of an action space by name; a `Box` alone has the name "".

    Raises:
        InputError: A part is neither a `Box` nor a `Discrete`.
    """
    parts = dict(space.spaces) if isinstance(space, spaces.Dict) else {"": space}
    if not all(isinstance(part, spaces.Box | spaces.Discrete) for part in parts.values()):
        raise InputError(f"an environment with actions {space} was given; only Box and Discrete can be flattened.")
    return parts


def _size(part: spaces.Space[Any]) -> int:
    """Return the number of flat numbers of a part of an action space."""
    # a Discrete with n values is n numbers, the largest of which counts
    return int(part.n) if isinstance(part, spaces.Discrete) else int(np.prod(part.shape or ()))


def _scale(part: Any, numbers: Flat) -> Any:
    """Scale numbers from -1 to 1 linearly to the bounds of a `Box`."""
    share = 0.5 * (1.0 + numbers.reshape(part.shape).astype(np.float64))
    return (part.low + share * (part.high - part.low)).astype(part.dtype)
