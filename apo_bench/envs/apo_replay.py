"""The door for learners: `APOReplay-v0`. It is long, as the docstring of the class is its page for learners."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, final

import gymnasium

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Correction, Observation, Outcome, Plan, Step
from apo_bench.envs.episode import VERDICTS, Episode, Scenes, Settings, step_info, verdicts, watch_human, with_options
from apo_bench.envs.rendering import FPS, MODES, Rendering
from apo_bench.envs.spaces import Action, Seen, action_space, as_seen_entries, moved, observation_space
from apo_bench.envs.starts import RobotSettings, carried_out
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.records import (
    DEPTH_CAMERA,
    USUAL,
    Predicted,
    TrialConfig,
    check,
    check_grip,
    check_together,
    noise_pair,
    refuse_noise,
)
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.scene import build_scene, data_with_arm
from apo_bench.trial.fitting import fitting_plan
from apo_bench.trial.predicted_success import abstained, predict_success
from apo_bench.trial.stages import (
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
    A human assembles a few parts on a table; a camera sees where each part was put, with an error. A robot arm with
    a parallel gripper repeats the assembly. One reset is one noisy demonstration, one step is one whole replay.

    ## Observation Space
    A `Dict`, one entry per operation of the assembly, in their order:

    - `goals`, `Box(n, 7)`: the pose of the moved part when the operation was over, (x, y, z, qw, qx, qy, qz),
      world frame, [m].
    - `covariance`, `Box(n, 6, 6)`: of the body twist by which each goal may be wrong, [m, rad].
    - `seen`, `MultiBinary(n)`: whether the operation was seen at all.

    Which faces touch is certain and stays the same: `env.unwrapped.assembly`. All of it as one typed object is
    `env.unwrapped.seen`.

    ## Action Space
    `Box(n, 6)`: a body twist (x, y, z, rx, ry, rz) per operation, [m, rad], in the frame of the moved part, within
    0.1 m and 0.5 rad per axis. The robot is asked for `goal @ exp(twist)`; zeros replay what was seen.

    ## Rewards
    1.0 if the finished assembly is right, else 0.0.

    ## Starting State
    The layout, the human's carelessness and the observation error are drawn anew. `reset(seed=k)` is trial k of
    sweeps and of `apo-bench run --seed k`, whatever came before; `reset()` draws the number of a trial, which is
    `env.unwrapped.trial` and never in `info`: whoever sees it can draw the truth. The parts stand where the
    demonstration began.

    `reset(options={...})` takes `noise_level`, `human_error_scale` and `clearance_mm`, with the meaning of the arguments below and for
    that episode alone; any other key is refused, but for `lerobot_new_rollout`, which means nothing here.

    ## Episode End
    Every step terminates. `info` then holds `is_success` and, the same, `success`; `as_demonstrated` (each contact was
    also made when and where it was shown), `loose_success`, `stage` and `code` (`done` and `ok`, or out of
    `apo_bench.records.outcomes`), `operation` (numbered from 1, or None), `sentence` and, if a plan was carried out,
    `predicted`: what it said about itself before, `fails`, `operation`, `code`, `size_mm`, and `predicted_success`, the
    probability of success that it stated. Never the truth, and nothing from which it can be drawn.
    A replay that takes more than 1000 s of simulated time, which only a schedule of a great many steps does, begins no
    further step: code `time_limit`. Wall time has no limit.
    A demonstration that went wrong itself (at most one in a hundred) is passed over by `reset()`; `reset(seed=k)`
    keeps it, says so in `info["demonstration"]`, and the step fails at stage `demonstrate`.

    ## Arguments
    - `scenario`: a name (`apo-bench scenario list`), the path of a scenario file, or a `Scenario`.
    - `noise_level`: standard deviation of the observation per axis, in mm and degrees; or the two as a pair.
    - `human_error_scale`: 0 is a careful human, 1 the scenario's, any number between or beyond a multiple.
    - `noise`: a noise model by name, as `module:name`, or the object; None stands for `isotropic`.
    - `pose_source`: `noise`, or `range`: poses are measured in depth images; `noise_level` is then the noise of a ray in mm, and
      there is no noise model.
    - `grasp`: `friction`, or `weld` for an ideal gripper.
    - `clearance_mm`: per side, of parts that fit into one another; None stands for the scenario's.
    - `arm`: by name, or an `Arm`.
    - `timestep_s`: of the physics.
    - `robot_error`: what is wrong with the robot itself, as standard deviations: `none`, or `hand_eye:1/0.2+tool:0.5`.
    - `feels`: whether the robot finds out by touching how wrong it is itself, as with the methods `METHOD+probe`.
    - `ft_sensor`: the force and torque sensor at its wrist, `external` or another name or noise, if it feels.
    - `assumed_robot_error`: how wrong it is said to be, `drawn`, `unstated`, or standard deviations, if it feels.
    - `max_reobservations`: how often `env.unwrapped.look(operations)`, or a corrector that can ask, may look at operations again.
    - `min_predicted_success`: a plan that promises to succeed with less than this probability is not carried out: reward 0, stage
      `promise`, code `abstained`. 0 carries out everything.
    - `fidelity`: `full`, or `near-contact`, which simulates only where parts may touch: a third of the time.
    - `render_mode`: `rgb_array` shows arm and parts before the step and where the replay ended after it, without a
      display; `rgb_array_list` the pictures of the whole replay; `human` opens a window when the replay begins.

    ## Copies
    An environment can be pickled and copied (`copy.deepcopy`) at any time, and the copy goes on exactly as the original
    would. The window of the mode `human` is not copied; a noise model of one's own must be picklable itself.

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
        probing: bool = False,
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
        self._abstain = min_predicted_success
        self._fidelity = fidelity
        self._robot = RobotSettings(robot_error, probing, ft_sensor, assumed_robot_error).checked()
        check_grip(self._robot.probing, grasp)
        self.render_mode = render_mode
        if pose_source == DEPTH_CAMERA and noise is not None:
            refuse_noise(noise)
        self._eye = pose_source
        self._model = USUAL if noise is None else noise
        self._allowed = max_reobservations
        self._usual = self._now = Settings(
            NoiseLevel(*noise_pair(noise_level, pose_source)), human_error_scale, clearance_mm
        )
        self._noise = self._usual_noise = make_noise(self._model, self._usual.noise_level)
        self._scene = build_scene(
            load_scenario(scenario), clearance_mm=clearance_mm, grasp=grasp, arm=arm, timestep_s=timestep_s
        )
        self._scenes = Scenes(self._scene)
        self.observation_space = observation_space(len(self.assembly))
        self.action_space = action_space(len(self.assembly))
        self._episode: Episode | None = None
        self._aim: Plan | None = None
        self._correction: Correction | None = None
        self._refused: Outcome | None = None
        self._over = False
        self._rendering = Rendering(self._scene.scenario.start)

    @property
    def assembly(self) -> Assembly:
        """The topology: what is certain."""
        return self._scene.scenario.assembly

    @property
    def seen(self) -> Observation:
        """What was seen in this episode, as one typed object.

        Raises:
            ResetNeeded: There is no episode yet.
        """
        return self._current("nothing was seen").seen

    @property
    def look(self) -> Reobservations | None:
        """Sees operations of this episode again, as often as `max_reobservations` says; None if it says 0.

        Raises:
            ResetNeeded: There is no episode yet.
        """
        return self._current("nothing was seen").look if self._allowed else None

    @property
    def trial(self) -> int:
        """The number of the trial of this episode, for whoever watches a learner: not for the learner.

        Anybody can draw the truth of a trial from its number.

        Raises:
            ResetNeeded: There is no episode yet.
        """
        return self._current("there is no trial").trial

    def _current(self, missing: str) -> Episode:
        if self._episode is None:
            raise gymnasium.error.ResetNeeded(f"{missing} yet; call reset() first.")
        return self._episode

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Watch another demonstration; `seed=k` is trial k.

        Args:
            options: `noise_level`, `human_error_scale` and `clearance_mm` of this episode; what is not said is as the environment was
                made.

        Raises:
            InputError: Another option, a value that is not allowed, or no demonstration comes out right.
        """
        if seed is not None:
            check("seed", seed)
        self._set(with_options(self._usual, options, self._eye))
        super().reset(seed=seed)
        self._over = True
        trial, simulated = watch_human(self._scene, self._now.human_error_scale, self._eye, seed, self.np_random)
        noise = (
            range_sensor(self._scene, simulated, self._now.noise_level.mm) if self._eye == DEPTH_CAMERA else self._noise
        )
        seen = observe_demonstration(simulated, noise, trial)
        look = reobservations_of(simulated, noise, trial, self._allowed) if self._allowed else None
        self._episode = Episode(trial, replace(simulated, images=None), seen, look)
        self.aim(seen.poses)
        self._refused = observation_failure(seen)
        self._over = False
        self._rendering.begin(simulated.layout.start)
        return as_seen_entries(seen), {"demonstration": simulated.demonstration.code}

    @check_arguments
    def step(self, action: Action) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Replay the goals, each moved by its twist.

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
        return as_seen_entries(self.seen), float(said["is_success"]), True, False, info

    def aim(
        self,
        goals: Array,
        schedule: Sequence[Step] = (),
        targets: Array | None = None,
        correction: Correction | None = None,
    ) -> None:
        """Replay this on zeros, until the next reset; for wrappers.

        Args:
            goals: (n, 4, 4), where every operation puts its part in the end.
            schedule: What to do and undo; empty stands for every operation once, in order.
            targets: (steps, 4, 4), as in `apo_bench.assembly.goals.Plan`; None stands for `goals` throughout.
            correction: What the goals come from, so that what it doubts is in what the plan promises.
        """
        plan = Plan(self.assembly, self.seen.start, goals, tuple(schedule))
        self._aim = plan if targets is None else replace(plan, step_poses=targets)
        self._correction = correction
        self._refused = None

    def planned(self, correction: Correction) -> Plan:
        """What the robot is to do after a correction of what was seen, as in a trial; for wrappers.

        Raises:
            InputError: The correction did not converge.
        """
        return fitting_plan(correction, self.seen, self._scene).plan

    def refuse(self, code: str, why: str) -> None:
        """Do not replay at all: the next step fails at stage `correct`; for wrappers."""
        self._refused = Outcome("correct", code, None, why)

    def render(self) -> Any:
        """The scene as an array (480, 640, 3) of uint8; in mode `rgb_array_list` those of the replay, (240, 320, 3), in
        `human`, which shows the replay itself, None.
        """
        return self._rendering.shown(self._scene, self.render_mode)

    def mujoco_data(self) -> Any:
        """What the mode `rgb_array` shows, as a new `mujoco.MjData`; it holds the truth."""
        return data_with_arm(self._scene, self._rendering.poses, self._rendering.state)

    def close(self) -> None:
        """Close the window, if one is open."""
        self._rendering.close()

    def _set(self, now: Settings) -> None:
        """Have noise and scene of these settings, or raise an `InputError` and change nothing."""
        noise = (
            self._usual_noise
            if now.noise_level == self._usual.noise_level
            else make_noise(self._model, now.noise_level)
        )
        self._scene = self._scenes.of(now.clearance_mm)
        self._now = now
        self._noise = noise

    def _replayed(self, plan: Plan) -> tuple[dict[str, bool], Outcome, Predicted | None, float | None]:
        """The verdicts, where it ended, what the plan had said, and how likely it had called its success."""
        episode = self._current("there is no trial")
        simulated = episode.simulated
        failed = dict.fromkeys(VERDICTS, False)
        if simulated.demonstration.code != "ok":
            return failed, demonstration_failure(simulated.demonstration), None, None
        if self._refused is not None:
            return failed, self._refused, None, None
        robot = self._robot
        predicted = predicted_outcome(plan, self._scene, robot.probing)
        told = robot.robot_error, robot.probing, robot.probing
        predicted_success = predict_success(plan, self.seen, self._correction, self._scene, *told)
        if predicted_success < self._abstain:
            return failed, abstained(predicted_success, self._abstain), predicted, predicted_success
        watch = self._rendering.watch(self._scene, self.render_mode)
        attempt = carried_out(robot, plan, self._scene, simulated.layout.poses, episode.trial, watch, self._fidelity)
        if attempt.result.reached.final is not None:
            self._rendering.poses = attempt.result.reached.final.poses
        return verdicts(attempt.verdict), trial_outcome(attempt), predicted, predicted_success
