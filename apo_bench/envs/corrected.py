"""A wrapper that corrects the observed poses of `APOReplay-v0`."""

from collections.abc import Callable
from typing import Any, final

import gymnasium

from apo_bench.arguments import check_arguments
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.envs.spaces import Action, Seen, packed
from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.records import CORRECTOR, CORRECTORS, SIMULATED


@final
@check_arguments
class CorrectPoses(gymnasium.Wrapper[Seen, Action, Seen, Action], gymnasium.utils.RecordConstructorArgs):
    """Correct the observed poses of `APOReplay-v0` at every reset.

    The observation holds the corrected poses, with the directions that contacts leave free chosen as in trials. An
    action of zeros replays them; another one is applied to them. If a correction does not converge, the step ends with
    reward 0 at stage `correct`. A correction that undoes operations is executed with its schedule; the twist of an
    operation then applies to every step of it.

    Examples:
        >>> import apo_bench, gymnasium, numpy as np
        >>> env = apo_bench.CorrectPoses(gymnasium.make("APOReplay-v0", scenario="block_on_block", noise_level=1))
        >>> observation, info = env.reset(seed=7)
        >>> observation, reward, terminated, truncated, info = env.step(np.zeros(env.action_space.shape))
        >>> reward
        1.0
    """

    def __init__(self, env: gymnasium.Env[Seen, Action], corrector: str | Callable[..., Any] = CORRECTOR) -> None:
        """Wrap an `APOReplay` environment.

        Args:
            env: An environment of `APOReplay-v0`.
            corrector: A name, `"package.module:name"`, or a callable `Observation -> Correction`.

        Raises:
            InputError: There is no such corrector, or the environment is another one.
        """
        from apo_bench.correction.correctors import correct
        from apo_bench.names import resolve

        gymnasium.utils.RecordConstructorArgs.__init__(self, corrector=corrector)
        super().__init__(env)
        if not isinstance(env.unwrapped, APOReplay):
            raise InputError(f"`CorrectPoses` wraps an APOReplay environment, {env.unwrapped} was given.")
        self._base: APOReplay = env.unwrapped
        self._corrector = resolve(corrector, {**CORRECTORS, **SIMULATED}, "corrector")
        if not callable(self._corrector):
            raise InputError(
                f"the corrector {corrector!r} was given; give a name, 'package.module:name' or a function."
            )
        self._correct = correct
        self._poses: Array | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Observe another demonstration and correct it."""
        seen, info = self.env.reset(seed=seed, options=options)
        reobserve = self._base.reobserve
        correction = self._correct(self._base.observation, self._corrector, reobserve if reobserve.left else None)
        poses = correction.poses
        if correction.ok:
            plan = self._base.planned(correction)
            poses = plan.target_poses
            self._base.aim(poses, plan.schedule, plan.step_poses, correction)
        else:
            self._base.refuse(correction.status, correction.sentence)
        self._poses = packed(poses)  # corrected poses, (n, 7)
        return self._with_poses(seen), {**info, "correction": correction.status}

    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Replay the corrected poses, each moved by its twist."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        return self._with_poses(seen), float(reward), terminated, truncated, info

    def _with_poses(self, seen: Seen) -> Seen:
        assert self._poses is not None
        return {**seen, "poses": self._poses.copy()}
