"""The environment `APOInsert-v0`; the docstring of the class is its page in the documentation.

The file is long because that page takes 100 lines, and Gymnasium asks for the whole environment as one class.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Poses, Snapshot
from apo_bench.envs.actions import read_action
from apo_bench.envs.episode import EpisodeSettings, Scenes, episode_options, replace_settings, trial_number
from apo_bench.envs.episode_start import EpisodeStart, TrialStarts, judged
from apo_bench.envs.insert_pictures import EpisodePictures
from apo_bench.envs.insert_spaces import (
    CAMERAS,
    PIXELS,
    Action,
    critic_entry,
    insert_space,
    pixels_key,
    policy_entries,
)
from apo_bench.envs.insertion_progress import InsertionProgress, begin_progress, find_phase
from apo_bench.envs.randomisation import LEAST_LAYOUTS, NONE, draw_variation
from apo_bench.envs.robot import RobotSettings
from apo_bench.envs.start_pool import StartPool, begin_trial, draw_evaluation_trial
from apo_bench.envs.tip_target import TipTarget, to_twist
from apo_bench.errors import InputError, require, unknown
from apo_bench.geometry import Array
from apo_bench.names import resolve
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.records import (
    CORRECTOR,
    CORRECTORS,
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
from apo_bench.simulation.scene import ScaledPhysics, Scene, build_data_with_arm, build_scene
from apo_bench.simulation.task.tip_control import PERIOD_S, TipControl

Seen = dict[str, Any]
ROBOT_ERROR = "hand_eye:0.5/0.1"
"""Default robot error: hand-eye calibration error, 0.5 mm and 0.1 degrees (1 sigma per axis)."""
RELEASE = 0.5
"""With `gripper` the hand opens if the last number of an action is above this; below its negative it stays closed."""
HORIZON = 400
"""Default number of actions of an operation."""
_REWARDS = ("sparse", "progress")
_STARTS = ("training", "evaluation")
_PLANS = ("uncorrected", "oracle", "nominal")  # plans that need no corrector


@check_arguments
class APOInsert(gymnasium.Env[Seen, Action]):
    """Insert one part that the robot holds before its hole.

    ## Description
    A trial is demonstrated, observed with errors and corrected. A robot with errors of its own executes all operations
    before one, picks its part and carries it to where the guarded motion into the hole begins, up to 160 mm before its
    end. From there the policy moves the tip, at 20 Hz, until the hand opens. Then the judge decides whether everything
    that stands is correct.

    ## Observation Space
    A `Dict` of float32, in the insertion frame: its third axis leads in, the fingers close along its first. Lengths are
    in mm, angles in degrees (rotation vectors), forces in N and torques in Nm.

    - `agent_pos`, `Box(13)`: by the encoders, the front of the part relative to its estimated target (3) and its
      rotation (3); the commanded minus the measured position and rotation (3, 3); the opening of each finger minus half
      the width of the part.
    - `wrench`, `Box(6)`: force and torque on the hand and what it holds, along the axes of the insertion frame, about
      the flange, from the force-torque sensor with its noise, its offset zeroed, and its low-pass filter.
    - `plan`, `Box(19)`: the estimated insertion axis in the world (3); the distance left along it and the smallest so
      far; the time left [s]; stated standard deviations of the error of the part relative to the hole, of the front and
      its rotation (6); the force above which the reward has a penalty; the displacement of the tip by the actions (6).
    - `pixels_scene`, `pixels_wrist`, `Box(96, 96, 3)` of uint8: images, those of `pixels`.
    - `critic`, `Box(10)`, with `critic=True`: the truth, for a critic during training. The error of the part relative
      to its target (6), of which the third number includes the distance left; the contact force on the part (3); 1 if
      it touches anything but the hand.

    `observation_groups` names the keys of the groups `policy` and `critic`.

    ## Action Space
    `Box(-1, 1, (6,))` of float32, in the insertion frame. Numbers beyond are clipped.

    - 0, 1 and 3 to 5 are a target: the lateral displacement of the front of the part from the line into the estimated
      hole, in `reach_mm`, and its rotation, in `reach_deg`. The tip moves there by at most `shift_mm` and `turn_deg`
      per axis and action.
    - 2 moves the tip along the axis by `shift_mm` per action.
    - 6, with `gripper=True`: above 0.5 the hand opens, which ends the episode; below -0.5 it stays closed.

    With `residual` this is added to a scripted approach: it moves in, stops at contact, pushes on lightly and opens the
    hand where it arrived. The tip also yields to forces, by 0.5 mm/s per newton.

    ## Rewards
    `reward="sparse"`: 1.0 at the end if the judge finds the operation and those before it correct, else 0.0.
    `reward="progress"` adds what the square of the deepest share of the hole that the part entered grows by, by the
    true poses; 1.0 in total. Each newton above `penalised_n` costs `force_penalty` per action.

    ## Starting State
    `reset(seed=k)` and `reset(options={"trial": k})` start at trial k. A trial below 100000 that fails before the
    operation is replaced by trial k + 100000, and so on; a larger number that fails is an error. `reset()` draws one
    of `layouts` training starts: trials from `first_trial` on with the same replacements, kept after they were first
    prepared. With `starts="evaluation"` it draws a trial below 100000. `reset(options={...})` also takes `noise_level`,
    `human_error_scale` and `clearance_mm`.

    ## Episode End
    It terminates when the hand opens, when the filtered force on the part (8 Hz) exceeds `fails_above_n`, and when
    something collides or is dropped. After `horizon` actions it is truncated: the hand opens and the judge decides.

    `info` of each step: `success` and `success_at_end`, False before the end; `success_once`, whether the part was
    fully inserted at any moment, or the judge says so; `phase`: `approach`, `contact`, `inside`, `arrived` or
    `released`; `force_n`, filtered; `depth_mm`, the true depth in the hole. The last one also has `is_success`, `code`
    and `sentence`.

    ## Arguments
    - `scenario`, `noise_level`, `human_error_scale`, `noise`, `grasp`, `clearance_mm`, `arm`, `timestep_s`: as in
      `APOReplay-v0`.
    - `operation`: numbered from 1; default: the last one.
    - `corrector`: a corrector, or `uncorrected`, `oracle`, `nominal`.
    - `robot_error`, `probe`, `ft_sensor`, `assumed_robot_error`: as in `APOReplay-v0`. The robot probes before the
      approach.
    - `residual`: whether actions are added to the approach; if not, they alone move the tip.
    - `gripper`: whether actions have a seventh number.
    - `shift_mm`, `turn_deg`, `reach_mm`, `reach_deg`: sizes of actions, as above.
    - `horizon`: actions of an episode, which `gymnasium.make` takes as the limit of its steps.
    - `fails_above_n`: force that ends an episode.
    - `reward`, `force_penalty`, `penalised_n`: as above.
    - `starts`: `training` or `evaluation`: what `reset()` without a seed draws.
    - `layouts`, `first_trial`: the training starts.
    - `randomise`: 0, or a scale, usually 1. In each episode friction and masses of parts change by up to 30 %, the
      gains of the servos by up to 10 %, and the force-torque sensor gets a dead zone of up to 0.1 N and 5 mNm, times
      the scale. There are then at least 256 layouts.
    - `pixels`: cameras of the images in observations: `scene`, `wrist` or both.
    - `critic`: whether observations have the group `critic`.
    - `render_mode`: `rgb_array`.

    The truth is only in `critic`, `info` and `env.unwrapped`: `trial`, `poses` of all parts, and `truth`, the true
    poses.

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
        gripper: bool = False,
        shift_mm: float = 1.0,
        turn_deg: float = 0.5,
        reach_mm: float = 4.0,
        reach_deg: float = 3.0,
        horizon: int = HORIZON,
        fails_above_n: float = 60.0,
        reward: str = "sparse",
        force_penalty: float = 0.0,
        penalised_n: float = 5.0,
        layouts: int = 16,
        first_trial: int = FIRST_TRAINING_TRIAL,
        starts: str = "training",
        randomise: float = 0.0,
        pixels: str | Sequence[str] = (),
        critic: bool = False,
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
        sizes = {"shift_mm": shift_mm, "turn_deg": turn_deg, "reach_mm": reach_mm, "reach_deg": reach_deg}
        for name, size in {**sizes, "fails_above_n": fails_above_n, "penalised_n": penalised_n}.items():
            require(0.0 < size < math.inf, f"{name} {size!r} was given; a number above 0 is allowed.")
        for name, size in (("force_penalty", force_penalty), ("randomise", randomise)):
            require(0.0 <= size <= 2.0, f"{name} {size!r} was given; a number from 0 to 2 is allowed.")
        for name, count in (("horizon", horizon), ("layouts", layouts)):
            require(count > 0, f"{name} {count!r} was given; a whole number above 0 is allowed.")
        check("seed", first_trial)
        self._cameras = (pixels,) if isinstance(pixels, str) else tuple(pixels)
        for camera in self._cameras:
            if camera not in CAMERAS:
                raise InputError(unknown("camera", str(camera), CAMERAS))
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
        self._gripper = bool(gripper)
        self.action_size = 7 if self._gripper else 6
        """How many numbers an action has."""
        self.target = TipTarget(to_twist(shift_mm, turn_deg), to_twist(reach_mm, reach_deg))
        """The displacement of the tip by the actions of this episode."""
        self._horizon = int(horizon)
        self._fails_above_n = fails_above_n
        self.share = float(reward == "progress")
        """Weight of the reward for progress: 1 with `reward="progress"`, else 0; divided among several operations."""
        self._force_penalty = force_penalty
        self._penalised_n = penalised_n
        self._randomise = randomise
        self._pool = StartPool(int(first_trial), max(int(layouts), LEAST_LAYOUTS if randomise else 1), {})
        self._evaluates = starts == "evaluation"
        self._critic = bool(critic)
        self._pictures = EpisodePictures()
        self._begun: EpisodeStart | None = None
        self._control: TipControl | None = None  # None until needed; then made from `_begun` and `_actions`
        self._variation = NONE
        self._scaled: ScaledPhysics | None = None
        self._wrist_seed = 0
        self._actions: list[Action] = []  # the actions of this episode, to repeat them in a copy
        self._over = True
        self._out_of_time = False
        self._best = 0.0  # smallest distance left along the insertion axis, [m]
        self._progress = InsertionProgress(0.0, 0.0, 0.0)
        self.observation_space = insert_space(self._cameras, self._critic)
        self.action_space = spaces.Box(-1.0, 1.0, (self.action_size,), np.float32)

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
    def most_actions(self) -> int:
        """Greatest number of actions of an episode."""
        return self._horizon

    @property
    def control(self) -> TipControl:
        """The controller of the tip in this episode, with its simulation, which holds the truth."""
        return self._at_work()

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
        self._restore_physics()
        if number is None and self._evaluates:
            number = draw_evaluation_trial(self.np_random)
        if number is None:
            self._begin(self._pool.draw(self._trials, self.np_random, self._trials is self._usual))
        else:
            self._begin(begin_trial(self._trials, number))
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
        self._restore_physics()
        self._begun = begun
        self._wrist_seed = int(self.np_random.integers(2**63))
        self._variation = draw_variation(self._randomise, self.np_random)
        self._scaled = ScaledPhysics(self._trials.scene, self._variation.scale) if self._randomise else None
        self._actions = []
        self._control = None
        self._over = False
        self._out_of_time = False
        control = self._at_work()
        self._best = control.begins
        self._progress = begin_progress(control, self._trials.scene.clearance_mm)

    def _restore_physics(self) -> None:
        """End the randomisation of the episode before; starts are prepared with the usual physics."""
        if self._scaled is not None:
            self._scaled.restore()
            self._scaled = None

    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Move the tip for 50 ms, or open the hand.

        Raises:
            ResetNeeded: The episode is over, or there is none.
            InputError: The action is not in the action space.
        """
        if self._over:
            raise gymnasium.error.ResetNeeded("the episode is over; call reset() for the next one.")
        given = read_action(action, self.action_size)
        control = self._at_work()
        self._actions.append(given)
        shared = 0.0
        try:
            self._move(control, given)
            # the third axis of the reading leads in, so its negative is the distance left
            self._best = min(self._best, -float(control.reading.tip[2]))
            shared = self.share * self._progress.update(self.off) - self._penalty(control)
            phase = find_phase(control, self._progress)
            info = self._end(control, float(given[6]) if self._gripper else 0.0)
        except ExecutionAborted as aborted:
            phase = "released"
            info = self._ended_by(aborted.code, aborted.part)
        self._over = bool(info)
        truncated = self._over and self._out_of_time
        info = self._step_info(control, "released" if info else phase) | info
        info["success_once"] |= info["success"]
        reward = shared + float(info["success"])
        return self._seen(), reward, self._over and not truncated, truncated, info

    def _penalty(self, control: TipControl) -> float:
        """Return the penalty for the present force."""
        return self._force_penalty * max(control.force_n - self._penalised_n, 0.0)

    def _step_info(self, control: TipControl, phase: str) -> dict[str, Any]:
        """Return the `info` of a step that does not end the episode."""
        progress = self._progress
        return {
            "success": False,
            "success_once": progress.inserted,
            "success_at_end": False,
            "phase": phase,
            "force_n": control.force_n,
            "depth_mm": 1e3 * progress.depth_m,
        }

    def render(self) -> Any:
        """Arm and parts, (480, 640, 3) of uint8."""
        if self.render_mode != "rgb_array":
            return None
        return self._pictures.draw(self._trials.scene, self._at_work(), "overview", 640, 480)

    def close(self) -> None:
        """Free the renderers."""
        self._pictures.close()

    @property
    def observation_groups(self) -> dict[str, tuple[str, ...]]:
        """The keys of observations for the policy, and of those for a critic, which hold the truth."""
        critic = ("critic",) if self._critic else ()
        keys = tuple(key for key in self.observation_space if key not in critic)  # type: ignore[attr-defined]
        return {"policy": keys, "critic": critic}

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

    def _at_work(self) -> TipControl:
        """Return the simulation of this episode; after a reset or a copy, make it and repeat the actions so far."""
        begun = self._now()
        if self._control is None:
            rng = np.random.default_rng(self._wrist_seed)
            self._control = TipControl(self._trials.scene, begun.start, rng, self._residual)
            self.target.restart()
            if not self._over:
                for action in self._actions:
                    self._move(self._control, action)
        return self._control

    def _move(self, control: TipControl, action: Action) -> None:
        """Apply an action for one period: move the target of the tip, and the tip towards it."""
        control.act(*self.target.move(action))

    def _end(self, control: TipControl, grip: float) -> dict[str, Any]:
        """Return the `info` of the last step, or an empty dictionary if the episode continues.

        Args:
            grip: The number of the action for the hand; 0 without.
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
        control = self._at_work()
        seen = policy_entries(
            control,
            self._variation.felt(control.reading.wrench),
            control.sigmas(self._now().covariance),
            self._best,
            self._horizon - len(self._actions),
            self._penalised_n,
            self.target.at,
        )
        if self._critic:
            seen["critic"] = critic_entry(control, self.off)
        for camera in self._cameras:
            seen[pixels_key(camera)] = self._pictures.draw(self._trials.scene, control, camera, PIXELS, PIXELS)
        return seen


def ended(code: str, sentence: str) -> dict[str, Any]:
    """Return what the `info` of the last step adds: success, outcome code and sentence."""
    success = code == "ok"
    return {**dict.fromkeys(("success", "is_success", "success_at_end"), success), "code": code, "sentence": sentence}
