"""The with-correction arm of an experiment: a wrapper that corrects what `APOReplay-v0` shows."""

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
class Corrected(gymnasium.Wrapper[Seen, Action, Seen, Action], gymnasium.utils.RecordConstructorArgs):
    """Correct what was seen, at every reset: the with-correction arm of an experiment.

    The observation then holds the corrected goals, with what contacts leave free chosen so that they fit, as in trials;
    zeros replay them, and an action composes on top. A correction
    that does not converge is not executed: the step ends with reward 0 at stage `correct`. One that takes work apart
    again is executed with its schedule; the twist of an operation then acts on every target of that operation.
    """

    def __init__(self, env: gymnasium.Env[Seen, Action], corrector: str | Callable[..., Any] = CORRECTOR) -> None:
        """Wrap an `APOReplay` environment.

        Args:
            corrector: A name, `"package.module:name"`, or a callable `Observation -> Correction`.

        Raises:
            InputError: There is no such corrector, or the environment is another one.
        """
        from apo_bench.correction.correctors import correct
        from apo_bench.names import resolve

        gymnasium.utils.RecordConstructorArgs.__init__(self, corrector=corrector)
        super().__init__(env)
        if not isinstance(env.unwrapped, APOReplay):
            raise InputError(f"`Corrected` wraps an APOReplay environment, {env.unwrapped} was given.")
        self._base: APOReplay = env.unwrapped
        self._corrector = resolve(corrector, {**CORRECTORS, **SIMULATED}, "corrector")
        if not callable(self._corrector):
            raise InputError(
                f"the corrector {corrector!r} was given; give a name, 'package.module:name' or a function."
            )
        self._correct = correct
        self._goals: Array | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Watch another demonstration and correct it."""
        seen, info = self.env.reset(seed=seed, options=options)
        correction = self._correct(self._base.seen, self._corrector, self._base.look)
        goals = correction.poses
        if correction.ok:
            plan = self._base.planned(correction)
            goals = plan.target_poses
            self._base.aim(goals, plan.schedule, plan.step_poses, correction)
        else:
            self._base.refuse(correction.status, correction.sentence)
        self._goals = packed(goals)
        return self._with_goals(seen), {**info, "correction": correction.status}

    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Replay the corrected goals, each moved by its twist."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        return self._with_goals(seen), float(reward), terminated, truncated, info

    def _with_goals(self, seen: Seen) -> Seen:
        assert self._goals is not None
        return {**seen, "poses": self._goals.copy()}
