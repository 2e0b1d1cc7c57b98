"""The environment `APOReplay-v0`; the docstring of the class is its page in the documentation.

The file is long because that page takes 80 lines, and Gymnasium asks for the whole environment as one class.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, final

import gymnasium

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Correction, Observation, Outcome, Plan, Step
from apo_bench.envs.episode import (
    VERDICTS,
    Episode,
    EpisodeSettings,
    Scenes,
    episode_options,
    replace_settings,
    simulate_trial,
    step_info,
    trial_number,
    verdicts,
)
from apo_bench.envs.rendering import FPS, MODES, Rendering
from apo_bench.envs.robot import RobotSettings, execute_plan
from apo_bench.envs.spaces import Action, Seen, action_space, moved, observation_entries, observation_space
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.records import (
    DEPTH_CAMERA,
    USUAL,
    FailurePrediction,
    TrialConfig,
    check,
    check_grip,
    check_together,
    parse_noise_level,
    refuse_noise,
)
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.scene import build_data_with_arm, build_scene
from apo_bench.trial.plan_fitting import fit_plan
from apo_bench.trial.predicted_success import abstain, predict_success
from apo_bench.trial.trial_stages import (
    demonstration_failure,
    observation_failure,
    observe_demonstration,
    predicted_outcome,
    range_sensor,
    reobservations_of,
    trial_outcome,
)


@final
@check_arguments
class APOReplay(gymnasium.Env[Seen, Action]):
    """Replay an observed assembly.

    ## Description
    A human assembles a few parts on a table; a camera observes the pose of each part with an error. A robot arm with a
    parallel gripper repeats the assembly. One reset is one noisy demonstration, one step is one whole replay.

    ## Observation Space
    A `Dict` with one entry per operation of the assembly, in their order:

    - `poses`, `Box(n, 7)`: the pose of the moved part after the operation, (x, y, z, qw, qx, qy, qz), world frame, [m].
    - `covariance`, `Box(n, 6, 6)`: of the error of each pose as a body twist, [m, rad].
    - `observed`, `MultiBinary(n)`: whether the operation was observed at all.

    The contacts are certain and stay the same: `env.unwrapped.assembly`. `env.unwrapped.observation` is the whole
    observation as one typed object.

    ## Action Space
    `Box(n, 6)`: a body twist (x, y, z, rx, ry, rz) per operation, [m, rad], in the frame of the moved part, within
    0.1 m and 0.5 rad per axis. The target pose is `pose @ exp(twist)`; zeros replay the observed poses.

    ## Rewards
    1.0 if the finished assembly is correct, else 0.0.

    ## Starting State
    Layout, human error and observation error are random. `reset(seed=k)` and `reset(options={"trial": k})` are trial k
    of sweeps and of `apo-bench run --seed k`; `reset()` draws the number of a trial. It is `env.unwrapped.trial` and
    never in `info`, since it determines the truth. The parts stand where the demonstration began.

    `reset(options={...})` also takes `noise_level`, `human_error_scale` and `clearance_mm`, as the arguments below, for
    that episode alone.

    ## Episode End
    Every step terminates. `info` then holds `success` (also as `is_success`), `as_demonstrated` (each contact was also
    made when and where it was demonstrated), `loose_success`, `stage` and `code` (`done` and `ok`, or one of
    `apo_bench.records.outcomes`), `operation` (numbered from 1, or None), `sentence` and, if a plan was executed,
    `failure_prediction` (`fails`, `operation`, `code`, `size_mm`) and `predicted_success`.
    A replay of more than 1000 s of simulated time ends with code `time_limit`. Wall time has no limit.
    `reset()` skips a demonstration that failed (at most one in a hundred). `reset(seed=k)` keeps it, with its code in
    `info["demonstration"]`, and the step fails at stage `demonstrate`.

    ## Arguments
    - `scenario`: a name (`apo-bench scenario list`), the path of a scenario file, or a `Scenario`.
    - `noise_level`: standard deviation of the observed poses per axis, in mm and degrees; or the two as a pair.
    - `human_error_scale`: factor on the human error that the scenario states; 0 is an ideal human.
    - `noise`: a noise model by name, as `module:name`, or the object; default: `isotropic`.
    - `pose_source`: `noise-model`, or `depth-camera`: poses are estimated from simulated depth images; `noise_level` is
      then in mm per ray, and there is no noise model.
    - `grasp`: `friction`, or `weld` for an ideal gripper.
    - `clearance_mm`: per side, between parts that fit; default: the scenario's.
    - `arm`: by name, or an `Arm`.
    - `timestep_s`: time step of the physics.
    - `robot_error`: standard deviations of the robot's own errors: `none`, or `hand_eye:1/0.2+tool:0.5`.
    - `probe`: whether the robot probes fixed surfaces to estimate its own calibration error, as methods with `+probe`.
    - `ft_sensor`: the force-torque sensor of a robot that probes, `wrist`, another name, or its noise.
    - `assumed_robot_error`: what a robot that probes assumes: `matched`, `unknown`, or standard deviations.
    - `max_reobservations`: how often `env.unwrapped.reobserve(operations)`, or a corrector, may observe operations
      again.
    - `min_predicted_success`: a plan with a lower predicted success is not executed: reward 0, stage
      `predicted-success`, code `abstained`. 0 executes every plan.
    - `fidelity`: `full`, or `near-contact`, which simulates only where parts may touch, in a third of the time.
    - `render_mode`: `rgb_array` renders arm and parts before the step, and the end of the replay after it, without a
      display; `rgb_array_list` the frames of the replay; `human` opens a window when the replay begins.

    ## Copies
    An environment can be pickled and copied (`copy.deepcopy`) at any time. The copy continues exactly as the original
    does, without the window of the mode `human`; your own noise model must be picklable.

    ## Version History
    - v0: first version.
    """

    metadata: dict[str, Any] = {"render_modes": [*MODES], "render_fps": FPS}  # noqa: RUF012

    def __init__(
        self,
        scenario: str | Path | Scenario = "stick_in_tower",
        noise_level: float | Sequence[float] = 1.0,
        human_error_scale: float = TrialConfig.human_error_scale,
        noise: str | Callable[..., Any] | None = None,
        grasp: str = TrialConfig.grasp,
        clearance_mm: float | None = None,
        arm: str | Arm = TrialConfig.arm,
        timestep_s: float = TrialConfig.timestep_s,
        pose_source: str = TrialConfig.pose_source,
        max_reobservations: int = TrialConfig.max_reobservations,
        robot_error: str = TrialConfig.robot_error,
        probe: bool = False,
        ft_sensor: str = TrialConfig.ft_sensor,
        assumed_robot_error: str = TrialConfig.assumed_robot_error,
        min_predicted_success: float = TrialConfig.min_predicted_success,
        fidelity: str = TrialConfig.fidelity,
        render_mode: str | None = None,
    ) -> None:
        require(
            render_mode in (None, *self.metadata["render_modes"]),
            f"the render mode '{render_mode}' was given; use rgb_array, rgb_array_list, human or None.",
        )
        check("pose_source", pose_source)
        check("max_reobservations", max_reobservations)
        check("min_predicted_success", min_predicted_success)
        check("fidelity", fidelity)
        check_together(fidelity, grasp)
        self._min_predicted_success = min_predicted_success
        self._fidelity = fidelity
        self._robot = RobotSettings(robot_error, probe, ft_sensor, assumed_robot_error).checked()
        check_grip(self._robot.probe, grasp)
        self.render_mode = render_mode
        if pose_source == DEPTH_CAMERA and noise is not None:
            refuse_noise(noise)
        self._pose_source = pose_source
        self._model = USUAL if noise is None else noise
        self._allowed = max_reobservations
        # the usual settings, and those of this episode
        self._usual = self._now = EpisodeSettings(
            NoiseLevel(*parse_noise_level(noise_level, pose_source)), human_error_scale, clearance_mm
        )
        self._noise = self._usual_noise = make_noise(self._model, self._usual.noise_level)
        self._scene = build_scene(
            load_scenario(scenario), clearance_mm=clearance_mm, grasp=grasp, arm=arm, timestep_s=timestep_s
        )
        self._scenes = Scenes(self._scene)
        self.observation_space = observation_space(len(self.assembly))
        self.action_space = action_space(len(self.assembly))
        self._episode: Episode | None = None
        self._aim: Plan | None = None  # replayed by an action of zeros
        self._correction: Correction | None = None
        self._refused: Outcome | None = None  # why the next step fails without a replay
        self._over = False
        self._rendering = Rendering(self._scene.scenario.start)

    @property
    def assembly(self) -> Assembly:
        """The topology: what is certain."""
        return self._scene.scenario.assembly

    @property
    def observation(self) -> Observation:
        """The observation of this episode, as one typed object.

        Raises:
            ResetNeeded: There is no episode yet.
        """
        return self._current("nothing was observed").observation

    @property
    def reobserve(self) -> Reobservations:
        """Observes operations of this episode again, `max_reobservations` times.

        Raises:
            ResetNeeded: There is no episode yet.
        """
        return self._current("nothing was observed").reobserve

    @property
    def trial(self) -> int:
        """The number of the trial of this episode, which determines its truth; not for policies.

        Raises:
            ResetNeeded: There is no episode yet.
        """
        return self._current("there is no trial").trial

    def _current(self, missing: str) -> Episode:
        """Return the episode; without one, raise `ResetNeeded` with a sentence that begins with `missing`."""
        if self._episode is None:
            raise gymnasium.error.ResetNeeded(f"{missing} yet; call reset() first.")
        return self._episode

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Observe another demonstration; `seed=k` is trial k.

        Args:
            options: `trial`, and `noise_level`, `human_error_scale` and `clearance_mm` of this episode; default: those
                of the environment.

        Raises:
            InputError: Another option, a value that is not allowed, or no demonstration succeeds.
        """
        asked = episode_options(options)
        number = trial_number(seed, asked)
        self._set(replace_settings(self._usual, asked, self._pose_source))
        super().reset(seed=seed if seed is not None else number)
        self._over = True  # a failing reset leaves no episode to step
        source, scale = self._pose_source, self._now.human_error_scale
        trial, simulated = simulate_trial(self._scene, scale, source, number, self.np_random)
        measured = source == DEPTH_CAMERA
        noise = range_sensor(self._scene, simulated, self._now.noise_level.mm) if measured else self._noise
        observation = observe_demonstration(simulated, noise, trial)
        reobserve = reobservations_of(simulated, noise, trial, self._allowed)
        self._episode = Episode(trial, replace(simulated, images=None), observation, reobserve)
        self.aim(observation.poses)
        self._refused = observation_failure(observation)
        self._over = False
        self._rendering.begin(simulated.layout.start)
        return observation_entries(observation), {"demonstration": simulated.demonstration.code}

    @check_arguments
    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Replay the target poses, each moved by its twist.

        Raises:
            ResetNeeded: The episode is over, or there is none.
            InputError: The action is not in the action space.
        """
        if self._aim is None or self._over:
            raise gymnasium.error.ResetNeeded("one step is one whole replay; call reset() for the next demonstration.")
        plan = moved(self._aim, action, self.action_space)
        self._over = True
        said, end, predicted, predicted_success = self._replayed(plan)
        info = step_info(said, end, predicted, predicted_success)
        return observation_entries(self.observation), float(said["is_success"]), True, False, info

    def aim(
        self,
        target_poses: Array,
        schedule: Sequence[Step] = (),
        step_poses: Array | None = None,
        correction: Correction | None = None,
    ) -> None:
        """Replay this plan on zeros, until the next reset; for wrappers.

        Args:
            target_poses: (n, 4, 4), world frame, [m].
            schedule: As in `Plan`; default: every operation once, in order.
            step_poses: As in `Plan`; default: the target poses.
            correction: The correction that the poses come from; the predicted success takes its covariance.
        """
        plan = Plan(self.assembly, self.observation.start, target_poses, tuple(schedule))
        self._aim = plan if step_poses is None else replace(plan, step_poses=step_poses)
        self._correction = correction
        self._refused = None

    def planned(self, correction: Correction) -> Plan:
        """The plan of a correction of the observation, as in a trial; for wrappers.

        Raises:
            InputError: The correction did not converge.
        """
        return fit_plan(correction, self.observation, self._scene).plan

    def refuse(self, code: str, why: str) -> None:
        """Let the next step fail at stage `correct`, without a replay; for wrappers."""
        self._refused = Outcome("correct", code, None, why)

    def render(self) -> Any:
        """The scene, (480, 640, 3) of uint8; the frames of the replay, (240, 320, 3), in mode `rgb_array_list`; None in
        mode `human`.
        """
        return self._rendering.shown(self._scene, self.render_mode)

    def mujoco_data(self) -> Any:
        """The state that the mode `rgb_array` renders, a new `mujoco.MjData`; it holds the truth."""
        return build_data_with_arm(self._scene, self._rendering.poses, self._rendering.state)

    def close(self) -> None:
        """Close the window, if one is open."""
        self._rendering.close()

    def _set(self, now: EpisodeSettings) -> None:
        """Apply the settings of an episode; raise `InputError` without any change if one is not allowed."""
        noise = (
            self._usual_noise
            if now.noise_level == self._usual.noise_level
            else make_noise(self._model, now.noise_level)
        )
        self._scene = self._scenes.of(now.clearance_mm)
        self._now = now
        self._noise = noise

    def _replayed(self, plan: Plan) -> tuple[dict[str, bool], Outcome, FailurePrediction | None, float | None]:
        """Replay a plan unless it is rejected before.

        Returns:
            The verdicts by key, the outcome, the failure prediction and the predicted success; the last two are None if
            the demonstration or the correction failed.
        """
        episode = self._current("there is no trial")
        simulated = episode.simulated
        failed = dict.fromkeys(VERDICTS, False)
        if simulated.demonstration.code != "ok":
            return failed, demonstration_failure(simulated.demonstration), None, None
        if self._refused is not None:
            return failed, self._refused, None, None
        robot = self._robot
        predicted = predicted_outcome(plan, self._scene, robot.probe)
        drawn = robot.robot_error, robot.probe, robot.probe  # a robot that probes also searches by a spiral
        predicted_success = predict_success(plan, self.observation, self._correction, self._scene, *drawn)
        if predicted_success < self._min_predicted_success:
            failure = abstain(predicted_success, self._min_predicted_success)
            return failed, failure, predicted, predicted_success
        watch = self._rendering.watch(self._scene, self.render_mode)
        attempt = execute_plan(robot, plan, self._scene, simulated.layout.poses, episode.trial, watch, self._fidelity)
        if attempt.result.reached.final is not None:
            self._rendering.poses = attempt.result.reached.final.poses
        return verdicts(attempt.verdict), trial_outcome(attempt), predicted, predicted_success
