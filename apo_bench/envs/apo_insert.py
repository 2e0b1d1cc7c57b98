"""One operation for learners: `APOInsert-v0`. It is long, as the docstring of the class is its page for learners."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Outcome, Poses, Snapshot
from apo_bench.envs.episode import asked_options
from apo_bench.envs.spaces import PIXELS, insert_space, is_uncorrected
from apo_bench.envs.starts import Begun, RobotSettings, Trials, judged
from apo_bench.errors import InputError, require, shown, unknown
from apo_bench.geometry import Array
from apo_bench.names import resolve
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.records import (
    CORRECTOR,
    CORRECTORS,
    EVALUATION_STARTS,
    FIRST_TRAINING_TRIAL,
    SIMULATED,
    USUAL,
    TrialConfig,
    check,
    noise_pair,
    sentence,
)
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.robot import ExecutionAborted
from apo_bench.simulation.scene import Scene, build_scene, data_with_arm
from apo_bench.simulation.task.tip_control import PERIOD_S, TipControl

Seen = dict[str, Any]
Action = NDArray[np.float32]
ROBOT_ERROR = "hand_eye:0.5/0.1"
"""What is wrong with the robot as usual."""
LETS_GO = 0.5
"""Of the seventh number of an action: above, the hand lets go; below its negative, it holds."""
MOST_TRIES = 100
"""So many trials in a row may never come to the operation before `reset()` gives up."""
_REWARDS = ("judge", "progress")
_STARTS = ("training", "evaluation")
_PLANS = ("uncorrected", "oracle", "nominal")


@check_arguments
class APOInsert(gymnasium.Env[Seen, Action]):
    """Insert one part that the robot holds before its mouth.

    ## Description
    A trial of the bench is demonstrated, seen with errors and corrected; a robot with errors of its own carries out all
    operations before one, takes its part and holds it before where it goes in. From there on the learner leads the tip,
    at 20 Hz, until the hand lets go. Then the judge says whether all that stands is right.

    ## Observation Space
    A `Dict` of float32, in the frame of the way in: its third axis leads in, the fingers close along its first.
    Lengths are in mm, angles in degrees (rotation vectors), forces in N and Nm.

    - `agent_pos`, `Box(13)`: where the front of the part is less where it is believed to end (3), the turn (3), by the
      encoders; what is commanded less that (3, 3); the opening of each finger less half the width of the part.
    - `ft_sensor`, `Box(6)`: force and torque on the hand and what is in it, about the flange, by the sensor of robots that
      feel, with its noise, its offset that was zeroed, and its low pass.
    - `plan`, `Box(19)`: the way in, in the world (3); what is left of it and the least that was left so far; time left,
      [s]; standard deviations that are stated of the front and its turn (6); the last action (7).
    - `pixels`, `Box(96, 96, 3)` of uint8, if asked for.

    ## Action Space
    `Box(-1, 1, (7,))` of float32: a shift (3) and a turn (3) about the front of the part, in the same frame, of at most
    `shift_mm` and `turn_deg` per axis and action; above 0.5, the last number opens the hand, which ends the episode.
    With `residual` they are added to the approach of the bench, which goes in, stops where it strikes, goes on under a
    light push, and lets go where it arrived; a last number below -0.5 has it hold on. The tip gives way to forces by
    0.5 mm/s for each newton. It is led 15 mm and 10 degrees off the approach at most.

    ## Rewards
    1.0 at the end if the judge finds the operation, and those before it, right; else 0.0. With `reward="progress"` also
    the share of the way in by which the least that was left has become less, by the encoders; 1.0 in all.

    ## Starting State
    One of `layouts` trials from `first_trial` on, each made when it is first drawn and kept. Trials that fail before
    the operation begins are passed over. `reset(seed=k)` draws the same, and the same noise of the sensor, whatever
    came before. `reset(options={"trial": t})` is trial t, of which nothing is kept.
    With `starts="evaluation"`, `reset(seed=k)` begins at trial k, which is in no pool and in no data set; seeds are
    below 100000, and a trial that fails before the operation begins is replaced by trial k + 100000, or the next so
    many further. Different seeds begin at different trials.

    ## Episode End
    It terminates when the hand lets go: by the learner, by the approach, or after `horizon` actions; where the force
    on the part exceeds `fails_above_n`, behind a filter of 8 Hz; where something is struck or lost. `info` then holds
    `success` and `is_success`, `code` and `sentence`. Nothing is truncated, as the time that is left is seen.

    ## Arguments
    - `scenario`, `noise_level`, `human_error_scale`, `noise`, `grasp`, `clearance_mm`, `arm`, `timestep_s`: as of `APOReplay-v0`.
    - `operation`: counted from 1; None: the last one.
    - `corrector`: what the plan is made by: a corrector, or `none`, `oracle`, `nominal`.
    - `robot_error`, `feels`, `ft_sensor`, `assumed_robot_error`: as of `APOReplay-v0`. A robot that feels does all that it
      does before the approach.
    - `residual`: whether actions are added to the approach; False: they are all that moves the tip.
    - `shift_mm`, `turn_deg`: of an action of 1.
    - `horizon`: actions of an episode.
    - `fails_above_n`: see above.
    - `reward`: `judge` or `progress`.
    - `starts`: `training` or `evaluation`. Report what was reached from starts for evaluation.
    - `layouts`, `first_trial`: the pool of starts for training.
    - `pixels`: whether pictures are seen; they make a step slow.
    - `render_mode`: `rgb_array`.

    What is privileged is in `env.unwrapped` alone: `trial`, `poses` of all parts, and `truth`, the true goals.

    ## Version History
    - v0: first version.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": round(1 / PERIOD_S)}  # noqa: RUF012

    def __init__(
        self,
        scenario: str | Path | Scenario = "stick_in_tower",
        operation: int | None = None,
        noise_level: float | Sequence[float] = 1.0,
        human_error_scale: float = TrialConfig.human_error_scale,
        noise: str | Callable[..., Any] | None = None,
        corrector: Any = CORRECTOR,
        grasp: str = TrialConfig.grasp,
        clearance_mm: float | None = None,
        arm: str | Arm = TrialConfig.arm,
        timestep_s: float = TrialConfig.timestep_s,
        robot_error: str = ROBOT_ERROR,
        probing: bool = False,
        ft_sensor: str = TrialConfig.ft_sensor,
        assumed_robot_error: str = TrialConfig.assumed_robot_error,
        residual: bool = True,
        shift_mm: float = 1.0,
        turn_deg: float = 0.5,
        horizon: int = 200,
        fails_above_n: float = 60.0,
        reward: str = "judge",
        layouts: int = 16,
        first_trial: int = FIRST_TRAINING_TRIAL,
        starts: str = "training",
        pixels: bool = False,
        render_mode: str | None = None,
    ) -> None:
        require(
            render_mode in (None, *self.metadata["render_modes"]),
            f"the render mode '{render_mode}' was given; use rgb_array or None.",
        )
        if reward not in _REWARDS:
            raise InputError(unknown("reward", str(reward), _REWARDS))
        if starts not in _STARTS:
            raise InputError(unknown("kind of starts", str(starts), _STARTS))
        for name, size in (("shift_mm", shift_mm), ("turn_deg", turn_deg), ("fails_above_n", fails_above_n)):
            require(0.0 < size < math.inf, f"{name} {size!r} was given; a number above 0 is allowed.")
        for name, count in (("horizon", horizon), ("layouts", layouts)):
            require(count > 0, f"{name} {count!r} was given; a whole number above 0 is allowed.")
        check("seed", first_trial)
        check("human_error_scale", human_error_scale)
        self.render_mode = render_mode
        require(
            not isinstance(corrector, str) or "+" not in corrector,
            f"the corrector '{corrector}' was given; what follows + is of whole replays, so give what is before it.",
        )
        known = {**CORRECTORS, **SIMULATED, **dict.fromkeys(_PLANS, "")}
        planner = corrector if corrector in _PLANS else resolve(corrector, known, "corrector")
        loaded = load_scenario(scenario)
        n = len(loaded.assembly)
        k = n if operation is None else operation
        require(k in range(1, n + 1), f"operation {operation} was given; {loaded.name} has 1 to {n}.")
        self._trials = Trials(
            build_scene(loaded, clearance_mm=clearance_mm, grasp=grasp, arm=arm, timestep_s=timestep_s),
            int(k) - 1,
            human_error_scale,
            make_noise(USUAL if noise is None else noise, NoiseLevel(*noise_pair(noise_level, "noise"))),
            planner,
            RobotSettings(robot_error, probing, ft_sensor, assumed_robot_error).checked(),
        )
        self._residual = bool(residual)
        self.scale = np.repeat([1e-3 * shift_mm, math.radians(turn_deg)], 3)
        """Of an action of 1, [m, rad]."""
        self._horizon = int(horizon)
        self._fails_above_n = fails_above_n
        self.share = float(reward == "progress")
        """Of the way in, as a reward."""
        self._layouts = int(layouts)
        self._first = int(first_trial)
        self._evaluates = starts == "evaluation"
        self._pixels = bool(pixels)
        self._pool: dict[int, Begun | Outcome] = {}
        self._begun: Begun | None = None
        self._control: TipControl | None = None
        self._wrist_seed = 0
        self._actions: list[Action] = []
        self._over = True
        self._best = 0.0
        self.observation_space = insert_space(self._pixels)
        self.action_space = spaces.Box(-1.0, 1.0, (7,), np.float32)

    @property
    def trial(self) -> int:
        """The number of the trial of this episode: whoever sees it can draw the truth."""
        return self._now().trial

    @property
    def truth(self) -> Array:
        """The true goals up to this operation, (k, 4, 4), world frame, [m]."""
        return self._now().reference

    @property
    def poses(self) -> Poses:
        """Where all parts are, world frame, [m]."""
        return self._at_work().poses()

    @property
    def off(self) -> Array:
        """By how much the part is really off where it has to go, (6,), [m, rad], in the frame of the way in."""
        return self._now().off(self._at_work())

    @property
    def scene(self) -> Scene:
        """The compiled scene, with its scenario and its arm."""
        return self._trials.scene

    @property
    def operation(self) -> int:
        """The operation of this episode, from 1."""
        return self._now().start.operation + 1

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin at one of the starts.

        Args:
            options: `trial`: the number of the trial to begin with, and without a seed that of what is felt.

        Raises:
            InputError: Another option, a trial that never comes to the operation, or none of the pool does.
        """
        trial = asked_options(options, ("trial",)).get("trial")
        for number, called in ((seed, ""), (trial, "trial")):
            if number is not None:
                check("seed", number, called=called)
        of_evaluation = self._evaluates and trial is None
        if of_evaluation and seed is not None:
            require(
                seed < EVALUATION_STARTS,
                f"a seed of {seed} was given to reset(); starts for evaluation have seeds below {EVALUATION_STARTS}.",
            )
        chance = trial if seed is None else seed
        super().reset(seed=None if chance is None else int(chance))
        self._over = True
        self._begin(self._evaluation_start(seed) if of_evaluation else self._drawn(trial))
        return self._seen(), {}

    def _begin(self, begun: Begun) -> None:
        """Take up a start."""
        self._begun = begun
        self._wrist_seed = int(self.np_random.integers(2**63))
        self._actions = []
        self._control = None
        self._over = False
        self._best = self._at_work().begins

    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Lead the tip for 50 ms, or let go.

        Raises:
            ResetNeeded: The episode is over, or there is none.
            InputError: The action is not in the action space.
        """
        if self._over:
            raise gymnasium.error.ResetNeeded("the episode is over; call reset() for the next one.")
        try:
            given = np.asarray(action, dtype=np.float32)
        except (TypeError, ValueError):
            given = np.zeros(0, dtype=np.float32)
        if not self.action_space.contains(given):
            raise InputError(f"the action {shown(action)} was given; seven numbers from -1 to 1 are allowed.")
        control = self._at_work()
        self._actions.append(given.copy())
        before = self._best
        shared = 0.0
        try:
            self._lead(control, given)
            self._best = min(before, -float(control.feel.tip[2]))
            shared = self.share * max(before - max(self._best, 0.0), 0.0) / control.begins
            info = self._end(control, float(given[6]))
        except ExecutionAborted as aborted:
            info = self._said(aborted.code, aborted.part)
        self._over = bool(info)
        return self._seen(), shared + float(info.get("success", False)), self._over, False, info

    def render(self) -> Any:
        """Arm and parts, (480, 640, 3) of uint8."""
        return self._picture(640, 480) if self.render_mode == "rgb_array" else None

    def mujoco_data(self) -> Any:
        """The live `mujoco.MjData` of this episode; before the first one, parts at their start. It holds the truth."""
        if self._begun is None:
            return data_with_arm(self.scene, self.scene.scenario.start)
        return self._at_work().robot.data

    def __getstate__(self) -> dict[str, Any]:
        """All but the simulation, which is made again by the same actions."""
        return {**self.__dict__, "_control": None}

    def _now(self) -> Begun:
        if self._begun is None:
            raise gymnasium.error.ResetNeeded("there is no episode yet; call reset() first.")
        return self._begun

    def _drawn(self, trial: int | None) -> Begun:
        if trial is not None:
            begun = self._trials.begin(int(trial))
            if isinstance(begun, Outcome):
                raise InputError(f"trial {trial} does not come to this operation: {begun.sentence}.")
            return begun
        why = ""
        for _ in range(MOST_TRIES):
            drawn = self._first + int(self.np_random.integers(self._layouts))
            if drawn not in self._pool:
                self._pool[drawn] = self._trials.begin(drawn)
            found = self._pool[drawn]
            if isinstance(found, Begun):
                return found
            why = found.sentence
        raise InputError(
            f"{MOST_TRIES} draws of {self._layouts} layouts did not come to this operation, the last one since "
            f"{why}; give more layouts, a lower level or a smaller robot error."
        )

    def _evaluation_start(self, seed: int | None) -> Begun:
        """The first of the trials of a seed that comes to the operation; None draws the seed."""
        first = int(self.np_random.integers(EVALUATION_STARTS)) if seed is None else int(seed)
        why = ""
        for number in range(first, FIRST_TRAINING_TRIAL, EVALUATION_STARTS):
            begun = self._trials.begin(number)
            if isinstance(begun, Begun):
                return begun
            why = begun.sentence
        raise InputError(
            f"no trial of seed {first} comes to this operation, the last one since {why}; give a lower level."
        )

    def _at_work(self) -> TipControl:
        """The simulation of this episode, made anew after a reset and in a copy."""
        begun = self._now()
        if self._control is None:
            rng = np.random.default_rng(self._wrist_seed)
            self._control = TipControl(self._trials.scene, begun.start, rng, self._residual)
            if not self._over:
                for action in self._actions:
                    self._lead(self._control, action)
        return self._control

    def _lead(self, control: TipControl, action: Action) -> None:
        control.act(*np.split(self.scale * action[:6].astype(np.float64), 2))

    def _end(self, control: TipControl, grip: float) -> dict[str, Any]:
        """What is said at the end, or nothing if it goes on."""
        if control.force_n > self._fails_above_n:
            return self._said("force_stop")
        last = len(self._actions) == self._horizon
        if not (last or grip > LETS_GO or (self._residual and control.arrived and grip >= -LETS_GO)):
            return {}
        return self._done(control, control.let_go())

    def _done(self, control: TipControl, reached: Snapshot) -> dict[str, Any]:
        """What is said once the hand has let go."""
        begun = self._now()
        verdict = judged(self._trials.scene, (*begun.start.after, reached), reached, begun.reference)
        return self._said("ok" if verdict.success else verdict.rests_on.code, why=verdict.rests_on.why)

    def _said(self, code: str, part: str = "", why: str = "") -> dict[str, Any]:
        k = self._now().start.operation
        main = self._trials.scene.scenario.assembly.operations[k].main
        said = sentence(code, part=part or main, operation=k) + (f": {why}" if why else "")
        return ended(code, said)

    def _seen(self) -> Seen:
        actions = self._actions
        seen = is_uncorrected(
            self._at_work(),
            self._now().covariance,
            self._best,
            self._horizon - len(actions),
            actions[-1] if actions else np.zeros(7, dtype=np.float32),
        )
        return {**seen, "pixels": self._picture(PIXELS, PIXELS)} if self._pixels else seen

    def _picture(self, width: int, height: int) -> Any:
        from apo_bench.simulation.scene.render import picture_with_arm

        control = self._at_work()
        state = np.array(control.robot.data.qpos)
        return picture_with_arm(self._trials.scene, control.start.parts, state, width, height)


def ended(code: str, sentence: str) -> dict[str, Any]:
    """What is said at the end."""
    return {"success": code == "ok", "is_success": code == "ok", "code": code, "sentence": sentence}
