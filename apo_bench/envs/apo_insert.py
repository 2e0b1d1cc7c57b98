"""The environment `APOInsert-v0`; the docstring of the class is its page in the documentation.

The file is long because that page takes 70 lines, and Gymnasium asks for the whole environment as one class.
"""

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
from apo_bench.envs.episode import EpisodeSettings, Scenes, episode_options, replace_settings, trial_number
from apo_bench.envs.episode_start import EpisodeStart, TrialStarts, judged
from apo_bench.envs.robot import RobotSettings
from apo_bench.envs.spaces import PIXELS, insert_observation, insert_space
from apo_bench.errors import InputError, require, shown, unknown
from apo_bench.geometry import Array
from apo_bench.names import resolve
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.records import (
    CORRECTOR,
    CORRECTORS,
    EVALUATION_STARTS,
    FIRST_TRAINING_TRIAL,
    NOISE_MODEL,
    SIMULATED,
    USUAL,
    TrialConfig,
    check,
    describe_outcome,
    parse_noise_level,
)
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.robot import ExecutionAborted
from apo_bench.simulation.scene import Scene, build_data_with_arm, build_scene
from apo_bench.simulation.task.tip_control import PERIOD_S, TipControl

Seen = dict[str, Any]
Action = NDArray[np.float32]
ROBOT_ERROR = "hand_eye:0.5/0.1"
"""Default robot error: hand-eye calibration error, 0.5 mm and 0.1 degrees (1 sigma per axis)."""
RELEASE = 0.5
"""The hand opens if the last number of an action is above this; below its negative the approach keeps it closed."""
MOST_TRIES = 100
"""`reset()` gives up after this many drawn trials in a row that fail before the operation."""
HORIZON = 200
"""Default number of actions of an operation."""
_REWARDS = ("judge", "progress")
_STARTS = ("training", "evaluation")
_PLANS = ("uncorrected", "oracle", "nominal")  # plans that need no corrector


@check_arguments
class APOInsert(gymnasium.Env[Seen, Action]):
    """Insert one part that the robot holds before its hole.

    ## Description
    A trial is demonstrated, observed with errors and corrected. A robot with errors of its own executes all operations
    before one, picks its part and holds it before the hole entrance. From there the policy moves the tip, at 20 Hz,
    until the hand opens. Then the judge decides whether everything that stands is correct.

    ## Observation Space
    A `Dict` of float32, in the frame of the insertion axis: its third axis leads in, the fingers close along its first.
    Lengths are in mm, angles in degrees (rotation vectors), forces in N and torques in Nm.

    - `agent_pos`, `Box(13)`: by the encoders, the front of the part relative to its estimated target (3) and its
      rotation (3); the commanded minus the measured position and rotation (3, 3); the opening of each finger minus half
      the width of the part.
    - `wrench`, `Box(6)`: force and torque on the hand and what it holds, about the flange, from the force-torque sensor
      with its noise, its offset zeroed, and its low-pass filter.
    - `plan`, `Box(19)`: the insertion axis in the world (3); the distance left along it and the smallest so far; the
      time left [s]; stated standard deviations of the front and its rotation (6); the last action (7).
    - `pixels`, `Box(96, 96, 3)` of uint8, with `pixels=True`.

    ## Action Space
    `Box(-1, 1, (7,))` of float32: a translation (3) and a rotation (3) about the front of the part, in the same frame,
    of at most `shift_mm` and `turn_deg` per axis and action. The last number opens the hand above 0.5, which ends the
    episode. With `residual` actions are added to a scripted approach: it moves in, stops at contact, pushes on lightly
    and opens the hand where it arrived; a last number below -0.5 keeps the hand closed. The tip yields to forces by
    0.5 mm/s per newton. It moves at most 15 mm and 10 degrees away from the approach.

    ## Rewards
    1.0 at the end if the judge finds the operation and those before it correct, else 0.0. With `reward="progress"` also
    the share of the distance by which the smallest distance left became smaller, by the encoders; 1.0 in total.

    ## Starting State
    `reset(seed=k)` and `reset(options={"trial": k})` start at trial k. A trial below 100000 that fails before the
    operation is replaced by trial k + 100000, and so on; a larger number that fails is an error. `reset()` draws one
    of `layouts` trials from `first_trial` on, which are kept after they were first prepared, or with
    `starts="evaluation"` a trial below 100000. Data sets and the pool contain none of these. `reset(options={...})`
    also takes `noise_level`, `human_error_scale` and `clearance_mm`.

    ## Episode End
    It terminates when the hand opens, when the filtered force on the part (8 Hz) exceeds `fails_above_n`, and when
    something collides or is dropped. After `horizon` actions it is truncated: the hand opens and the judge decides.
    `info` then holds `success` (also as `is_success`), `code` and `describe_outcome`; before, `success` is False.

    ## Arguments
    - `scenario`, `noise_level`, `human_error_scale`, `noise`, `grasp`, `clearance_mm`, `arm`, `timestep_s`: as in
      `APOReplay-v0`.
    - `operation`: numbered from 1; default: the last one.
    - `corrector`: a corrector, or `uncorrected`, `oracle`, `nominal`.
    - `robot_error`, `probe`, `ft_sensor`, `assumed_robot_error`: as in `APOReplay-v0`. The robot probes before the
      approach.
    - `residual`: whether actions are added to the approach; if not, they alone move the tip.
    - `shift_mm`, `turn_deg`: translation and rotation of an action of 1.
    - `horizon`: actions of an episode. Another one than 200 is also given to `gymnasium.make` as `max_episode_steps`.
    - `fails_above_n`: force that ends an episode.
    - `reward`: `judge` or `progress`.
    - `starts`: `training` or `evaluation`: what `reset()` without a seed draws.
    - `layouts`, `first_trial`: the pool of trials for training.
    - `pixels`: whether observations have images, which makes a step slow.
    - `render_mode`: `rgb_array`.

    Privileged information is only in `env.unwrapped`: `trial`, `poses` of all parts, and `truth`, the true poses.

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
        probe: bool = False,
        ft_sensor: str = TrialConfig.ft_sensor,
        assumed_robot_error: str = TrialConfig.assumed_robot_error,
        residual: bool = True,
        shift_mm: float = 1.0,
        turn_deg: float = 0.5,
        horizon: int = HORIZON,
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
        self.render_mode = render_mode
        require(
            not isinstance(corrector, str) or "+" not in corrector,
            f"the corrector '{corrector}' was given; an insertion takes a corrector without +spiral or +probe.",
        )
        known = {**CORRECTORS, **SIMULATED, **dict.fromkeys(_PLANS, "")}
        planner = corrector if corrector in _PLANS else resolve(corrector, known, "corrector")
        loaded = load_scenario(scenario)
        n = len(loaded.assembly)
        k = n if operation is None else operation
        require(k in range(1, n + 1), f"operation {operation} was given; {loaded.name} has 1 to {n}.")
        scene = build_scene(loaded, clearance_mm=clearance_mm, grasp=grasp, arm=arm, timestep_s=timestep_s)
        self._scenes = Scenes(scene)
        self._model = USUAL if noise is None else noise
        level = NoiseLevel(*parse_noise_level(noise_level))
        self._settings = EpisodeSettings(level, human_error_scale, clearance_mm)
        robot = RobotSettings(robot_error, probe, ft_sensor, assumed_robot_error).checked()
        self._trials = self._usual = TrialStarts(
            scene, int(k) - 1, human_error_scale, make_noise(self._model, level), planner, robot
        )
        self._residual = bool(residual)
        self.scale = np.repeat([1e-3 * shift_mm, math.radians(turn_deg)], 3)
        """Translation and rotation of an action of 1, (6,), [m, rad]."""
        self._horizon = int(horizon)
        self._fails_above_n = fails_above_n
        self.share = float(reward == "progress")
        """Weight of the reward for progress: 1 with `reward="progress"`, else 0; divided among several operations."""
        self._layouts = int(layouts)
        self._first = int(first_trial)
        self._evaluates = starts == "evaluation"
        self._pixels = bool(pixels)
        self._pool: dict[int, EpisodeStart | Outcome] = {}  # trial -> its start, or why it has none
        self._begun: EpisodeStart | None = None
        self._control: TipControl | None = None  # None until needed; then made from `_begun` and `_actions`
        self._wrist_seed = 0
        self._actions: list[Action] = []  # the actions of this episode, to repeat them in a copy
        self._over = True
        self._out_of_time = False
        self._best = 0.0  # smallest distance left along the insertion axis, [m]
        self.observation_space = insert_space(self._pixels)
        self.action_space = spaces.Box(-1.0, 1.0, (7,), np.float32)

    @property
    def trial(self) -> int:
        """The number of the trial of this episode, which determines its truth."""
        return self._now().trial

    @property
    def truth(self) -> Array:
        """The true poses up to this operation, (k, 4, 4), world frame, [m]."""
        return self._now().reference

    @property
    def poses(self) -> Poses:
        """Where all parts are, world frame, [m]."""
        return self._at_work().poses()

    @property
    def off(self) -> Array:
        """The true error of the part relative to its target, (6,), [m, rad], in the frame of the insertion axis."""
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
        """Start at a trial; `seed=k` is trial k.

        Args:
            options: `trial`, and `noise_level`, `human_error_scale` and `clearance_mm` of this episode; default: those
                of the environment.

        Raises:
            InputError: Another option, a value that is not allowed, or a trial that fails before the operation.
        """
        asked = episode_options(options)
        number = trial_number(seed, asked)
        settings = replace_settings(self._settings, asked, NOISE_MODEL)
        super().reset(seed=seed if seed is not None else number)
        self._over = True
        self._trials = self._usual if settings == self._settings else self._changed(settings)
        if number is None and self._evaluates:
            number = int(self.np_random.integers(EVALUATION_STARTS))
        self._begin(self._drawn() if number is None else self._start_of(number))
        return self._seen(), {}

    def _changed(self, settings: EpisodeSettings) -> TrialStarts:
        """Return the trials with other settings than those of the environment."""
        return self._usual._replace(
            scene=self._scenes.of(settings.clearance_mm),
            human_error_scale=settings.human_error_scale,
            noise=make_noise(self._model, settings.noise_level),
        )

    def _begin(self, begun: EpisodeStart) -> None:
        """Begin an episode or, in `APOAssemble`, its next operation."""
        self._begun = begun
        self._wrist_seed = int(self.np_random.integers(2**63))
        self._actions = []
        self._control = None
        self._over = False
        self._out_of_time = False
        self._best = self._at_work().begins

    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Move the tip for 50 ms, or open the hand.

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
            self._move(control, given)
            # the third axis of the reading leads in, so its negative is the distance left
            self._best = min(before, -float(control.reading.tip[2]))
            # progress as a share of the whole distance; going beyond the target earns nothing more
            shared = self.share * max(before - max(self._best, 0.0), 0.0) / control.begins
            info = self._end(control, float(given[6]))
        except ExecutionAborted as aborted:
            info = self._ended_by(aborted.code, aborted.part)
        self._over = bool(info)
        truncated = self._over and self._out_of_time
        info = info or {"success": False}
        reward = shared + float(info["success"])
        return self._seen(), reward, self._over and not truncated, truncated, info

    def render(self) -> Any:
        """Arm and parts, (480, 640, 3) of uint8."""
        return self._picture(640, 480) if self.render_mode == "rgb_array" else None

    def mujoco_data(self) -> Any:
        """The live `mujoco.MjData` of this episode; before the first one, parts at their start. It holds the truth."""
        if self._begun is None:
            return build_data_with_arm(self.scene, self.scene.scenario.start)
        return self._at_work().robot.data

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the simulation, which a copy rebuilds by repeating the actions."""
        return {**self.__dict__, "_control": None}

    def _now(self) -> EpisodeStart:
        """Return the start of this episode; without one, raise `ResetNeeded`."""
        if self._begun is None:
            raise gymnasium.error.ResetNeeded("there is no episode yet; call reset() first.")
        return self._begun

    def _drawn(self) -> EpisodeStart:
        """Return the start of a random trial of the training pool that does not fail before the operation."""
        pool = self._pool if self._trials is self._usual else {}  # the pool holds starts with the usual settings only
        why = ""
        for _ in range(MOST_TRIES):
            drawn = self._first + int(self.np_random.integers(self._layouts))
            if drawn not in pool:
                pool[drawn] = self._trials.begin(drawn)
            found = pool[drawn]
            if isinstance(found, EpisodeStart):
                return found
            why = found.sentence
        raise InputError(
            f"{MOST_TRIES} draws from {self._layouts} layouts failed before this operation, the last one because "
            f"{why}; use more layouts, a lower noise level or a smaller robot error."
        )

    def _start_of(self, number: int) -> EpisodeStart:
        """Return the start of a trial, or of its first replacement that does not fail before the operation."""
        # only trials for evaluation have replacements
        last = FIRST_TRAINING_TRIAL if number < EVALUATION_STARTS else number + 1
        why = ""
        for replacement in range(number, last, EVALUATION_STARTS):
            begun = self._trials.begin(replacement)
            if isinstance(begun, EpisodeStart):
                return begun
            why = begun.sentence
        raise InputError(f"trial {number} fails before this operation: {why}; use another one, or a lower noise level.")

    def _at_work(self) -> TipControl:
        """Return the simulation of this episode; after a reset or a copy, make it and repeat the actions so far."""
        begun = self._now()
        if self._control is None:
            rng = np.random.default_rng(self._wrist_seed)
            self._control = TipControl(self._trials.scene, begun.start, rng, self._residual)
            if not self._over:
                for action in self._actions:
                    self._move(self._control, action)
        return self._control

    def _move(self, control: TipControl, action: Action) -> None:
        """Apply an action for one period: a translation (3) and a rotation (3), scaled to m and rad."""
        control.act(*np.split(self.scale * action[:6].astype(np.float64), 2))

    def _end(self, control: TipControl, grip: float) -> dict[str, Any]:
        """Return the `info` of the last step, or an empty dictionary if the episode continues.

        Args:
            grip: Last number of the action.
        """
        if control.force_n > self._fails_above_n:
            return self._ended_by("force_stop")
        # an approach that has arrived opens the hand itself, unless the action keeps it closed
        opens = grip > RELEASE or (self._residual and control.arrived and grip >= -RELEASE)
        self._out_of_time = not opens and len(self._actions) == self._horizon
        return self._done(control, control.let_go()) if opens or self._out_of_time else {}

    def _done(self, control: TipControl, reached: Snapshot) -> dict[str, Any]:
        """Return the `info` after the hand opened, with the judge's verdict."""
        begun = self._now()
        verdict = judged(self._trials.scene, (*begun.start.after, reached), reached, begun.reference)
        return self._ended_by("ok" if verdict.success else verdict.rests_on.code, why=verdict.rests_on.why)

    def _ended_by(self, code: str, part: str = "", why: str = "") -> dict[str, Any]:
        """Return the `info` of an episode that ended with this code.

        Args:
            part: The part that the code concerns; default: the one that is inserted.
            why: Reason that is added to the sentence.
        """
        k = self._now().start.operation
        main = self._trials.scene.scenario.assembly.operations[k].main
        said = describe_outcome(code, part=part or main, operation=k) + (f": {why}" if why else "")
        return ended(code, said)

    def _seen(self) -> Seen:
        """Return the present observation."""
        actions = self._actions
        seen = insert_observation(
            self._at_work(),
            self._now().covariance,
            self._best,
            self._horizon - len(actions),
            actions[-1] if actions else np.zeros(7, dtype=np.float32),
        )
        return {**seen, "pixels": self._picture(PIXELS, PIXELS)} if self._pixels else seen

    def _picture(self, width: int, height: int) -> Any:
        """Render the arm and the parts as they are now."""
        from apo_bench.simulation.scene.render import picture_with_arm

        control = self._at_work()
        state = np.array(control.robot.data.qpos)
        return picture_with_arm(self._trials.scene, control.start.parts, state, width, height)


def ended(code: str, sentence: str) -> dict[str, Any]:
    """Return the `info` of the last step: success, outcome code and sentence."""
    return {"success": code == "ok", "is_success": code == "ok", "code": code, "sentence": sentence}
