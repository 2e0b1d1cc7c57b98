"""Record trials as episodes of a data set: observations, plans, true poses, and frames of the replay."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.benchmark.datasets.card import FPS, DatasetMetadata, Field, RecordedEpisode, count_outcomes, write_card
from apo_bench.geometry import Array, pose
from apo_bench.io import write_columns
from apo_bench.records import TrialConfig, TrialRecord
from apo_bench.simulation.hooks import Hooks, Phase
from apo_bench.simulation.scene import WRIST_SENSORS, Scene, get_part_pose, switch_wrist_sensors_on
from apo_bench.trial.run import noise_of, run_trial
from apo_bench.trial.trial_stages import SimulatedDemonstration, observe_demonstration, simulate_demonstration

_OF_ROW = MappingProxyType(  # columns of a trial record that the table of episodes has -> meaning
    {
        "scenario": "the assembly",
        "seed": "number of the trial",
        "method": "what made the plan",
        "noise": "model of the camera",
        "noise_mm": "of the noise, mm",
        "noise_deg": "of the noise, degrees",
        "human_error_scale": "0 for a careful human, 1 for the scenario's",
        "success": "whether the assembly is right at the end; the judge's word",
        "as_demonstrated": "whether each contact was also made when and where it was shown",
        "failure_stage": "where it failed; null if it did not",
        "failure_code": "how it failed",
        "failure_operation": "which operation failed, from 1",
        "sentence": "the same in words",
        "sim_time_s": "simulated time of the replay, s",
        "config_hash": "of everything that this trial depends on",
    }
)
_POSES = "(x, y, z, qw, qx, qy, qz), world frame, m"  # layout of a pose, for the meanings below
OF_EPISODE: Mapping[str, str] = MappingProxyType(
    {
        **_OF_ROW,
        "parts": "names of the parts that can move, in the order of the frames",
        "main_parts": "the part that each of the n operations moves",
        "observed_poses": f"7 n numbers: where each part was seen after its operation, {_POSES}",
        "covariance": "36 n numbers: of the twist by which each seen goal may be wrong, frame of the part, m and rad",
        "observed": "n: whether the operation was seen at all",
        "true_poses": f"7 n numbers: the goals at which all contacts hold, {_POSES}",
        "planned_poses": f"7 n numbers: where the plan puts each part in the end, {_POSES}; null without a plan",
        "schedule": "what the plan does: k for operation k, -k where it undoes it, from 1",
    }
)
"""Column of an episode -> its meaning."""
KINDS = MappingProxyType(
    {
        **dict.fromkeys(("failure_stage", "failure_code"), "text"),
        "failure_operation": "whole",
        "planned_poses": "numbers",
        "schedule": "wholes",
    }
)
"""Column -> its type, for columns that may be null in all episodes; data sets with the same types can be joined."""
EPISODES: Mapping[str, str] = MappingProxyType(
    {
        "episode": "from 0; its frames are in frames/EPISODE.parquet, if it was replayed",
        **OF_EPISODE,
        "frames": "how many frames there are",
    }
)
"""Column of episodes.parquet -> its meaning."""
_WRENCH = Field(  # force and torque at the wrist, without zeroing
    ("fx", "fy", "fz", "tx", "ty", "tz"),
    "N, Nm",
    "flange",
    "force and torque that the arm exerts on its hand, weight and inertia of the hand and what is in it included",
)
FRAMES: Mapping[str, Field] = MappingProxyType(
    {
        "episode": Field((), "", "", "as above"),
        "t_s": Field((), "s", "", "simulated time"),
        "operation": Field((), "", "", "the operation that is done, from 1; null before the first"),
        "undoes": Field((), "", "", "whether it is undone"),
        "macro": Field((), "", "", "the macros of the motion, or the stage where it is none"),
        "force_n": Field((), "N", "", "contact force on what is held, at the wrist; 0 with an empty hand"),
        "joints": Field((), "rad or m", "", "positions of the arm's joints"),
        "fingers": Field((), "m", "", "positions of the fingers; 0 is closed"),
        "commands": Field((), "rad or m", "", "positions that the drives are commanded to, ahead of the path"),
        "wrench": _WRENCH,
        "part_poses": Field((), "m", "world", "7 numbers for each of `parts`: (x, y, z, qw, qx, qy, qz)"),
    }
)
"""Column of the tables of frames -> its meaning."""
_STEPWISE = ("operation", "undoes", "macro")
"""Columns that hold until the next sample; all other columns are interpolated between samples."""


class ReplayEpisode(NamedTuple):
    """One trial, with the samples of its replay as frames."""

    scene: Scene
    episode: dict[str, Any]
    frames: dict[str, Any]
    """Column -> one entry per frame; empty without a replay."""


@final
class _Recorder:
    """Samples the state of a replay every 20 ms."""

    def __init__(self, scene: Scene) -> None:
        self.plan: Plan | None = None
        self.parts = sorted(scene.work.free)
        self._scene = scene
        # column -> one entry per sample
        self._looks: dict[str, list[Any]] = {name: [] for name in FRAMES if name != "episode"}

    def hooks(self) -> Hooks:
        return Hooks(before_replay=self._start_replay, after_tick=self._append_sample)

    def _start_replay(self, plan: Plan) -> None:
        self.plan = plan

    def _append_sample(self, data: Any, phase: Phase) -> None:
        """Append a sample; called by the replay every 20 ms."""
        at = [get_part_pose(self._scene.work, data, part) for part in self.parts]
        look = (
            float(data.time),
            None if phase.operation is None else phase.operation + 1,
            phase.undoes,
            phase.macro,
            float(phase.force_n),
            [float(data.joint(f"arm/{joint}").qpos[0]) for joint in self._scene.arm.joints],
            [float(data.joint(f"arm/{finger}").qpos[0]) for finger in self._scene.arm.fingers],
            np.array(data.ctrl),
            np.concatenate([data.sensor(name).data for name in WRIST_SENSORS]),
            pose.pack(np.array(at)),
        )
        for column, entry in zip(self._looks.values(), look, strict=True):
            column.append(entry)

    def frames(self) -> dict[str, Any]:
        """Return the samples as `FPS` frames per second of simulated time; empty without a replay."""
        t = np.array(self._looks["t_s"])
        if not len(t):
            return {}
        at = t[0] + np.arange(int((t[-1] - t[0]) * FPS + 1e-6) + 1) / FPS  # times of the frames
        before = np.searchsorted(t, at + 1e-9, side="right") - 1  # index of the last sample not after each frame
        frames: dict[str, Any] = {}
        for name, looks in self._looks.items():
            if name in _STEPWISE:
                frames[name] = [looks[i] for i in before]
                continue
            x = np.array(looks, dtype=np.float64)
            if name == "part_poses":
                # a quaternion and its negative are one rotation: choose signs so that neighbours are near each other
                turned = np.einsum("tpi,tpi->tp", x[1:, :, 3:], x[:-1, :, 3:]) < 0.0
                x[1:, :, 3:] *= np.cumprod(np.where(turned, -1.0, 1.0), axis=0)[:, :, None]
            x = np.column_stack([np.interp(at, t, column) for column in x.reshape(len(t), -1).T])
            if name == "part_poses":
                turns = x.reshape(len(at), -1, 7)[:, :, 3:]
                turns /= np.linalg.norm(turns, axis=2, keepdims=True)  # linear interpolation shortens quaternions
            frames[name] = x if looks and np.ndim(looks[0]) else x[:, 0]  # one number per frame has shape (n,)
        return frames


def record_replays(trials: Iterable[TrialConfig], scenes: Mapping[str, Scene]) -> Iterator[ReplayEpisode]:
    """Run trials, each in the scene of its scenario, and record them.

    Raises:
        InputError: A trial cannot be run.
    """
    for settings in trials:
        scene = scenes[settings.scenario]
        recorder = _Recorder(scene)
        simulated = simulate_demonstration(
            scene, settings.human_error_scale, settings.seed, settings.pose_source, settings.secret_seed
        )
        with switch_wrist_sensors_on(scene.work.model):
            row = run_trial(settings, scene, simulated=simulated, watch=recorder.hooks())
        yield ReplayEpisode(scene, _make_episode(settings, scene, simulated, row, recorder), recorder.frames())


def write_parquet(found: Iterable[ReplayEpisode], about: DatasetMetadata, out: Path) -> tuple[int, int]:
    """Write replays as Parquet tables, and the card.

    Returns:
        The number of trials, and the number of successes.

    Raises:
        OSError: A file cannot be written.
    """
    (out / "frames").mkdir(parents=True)
    episodes: list[dict[str, Any]] = []
    for k, (_, episode, frames) in enumerate(found):
        n = len(frames.get("t_s", ()))
        episodes.append({"episode": k, **episode, "frames": n})
        if n:
            columns = [[k] * n, *(x.tolist() if isinstance(x, np.ndarray) else x for x in frames.values())]
            write_columns([*FRAMES], columns, out / "frames" / f"{k:06}.parquet")
    columns = [[each[name] for each in episodes] for name in EPISODES]
    write_columns([*EPISODES], columns, out / "episodes.parquet", KINDS)
    outcomes = count_outcomes(episodes)
    write_card(about, out, outcomes, {"episodes.parquet": EPISODES, "frames/*.parquet": FRAMES})
    return outcomes.total(), outcomes["ok"]


def describe_replays(found: Sequence[Scene], command: str, robot: str) -> DatasetMetadata:
    """Return the metadata of replays in these scenes, which all have one arm.

    Args:
        command: The command line that makes the data set.
        robot: Name of the arm.
    """
    arm = found[0].arm
    model = found[0].work.model
    slots = range(max(len(scene.work.free) for scene in found))  # smaller assemblies leave slots empty
    names = tuple(f"part{k}_{axis}" for k in slots for axis in ("x", "y", "z", "qw", "qx", "qy", "qz"))
    joints = Field((*arm.joints, *arm.fingers), "rad or m", "", "positions of the arm's joints, and of the fingers")
    commands = tuple(model.actuator(k).name.removeprefix("arm/") for k in range(model.nu))
    return DatasetMetadata(
        name="replays",
        summary="A human assembles parts, a camera sees with an error where each was put, a method plans, a robot arm "
        "replays, and a judge looks at physics alone. `apo-bench run` runs the trial of a seed again. Numbers of a "
        f"frame lie between two looks 20 ms apart. Joints and fingers: {', '.join(joints.names)}.",
        command=command,
        fields={
            "state": joints,
            "wrench": _WRENCH,
            "environment_state": Field(
                names,
                "m",
                "world",
                "poses of `parts`, (x, y, z, qw, qx, qy, qz); behind the last of a smaller assembly, identities",
            ),
            "operation": Field(
                ("operation",), "", "", "the operation that is done, from 1; less than 0 if it is undone"
            ),
        },
        action=Field(commands, "rad or m", "", FRAMES["commands"].meaning),
        episodes=OF_EPISODE,
        robot=robot,
    )


def convert_replays(
    found: Iterable[ReplayEpisode], about: DatasetMetadata, say: Callable[[str], None]
) -> Iterator[RecordedEpisode]:
    """Yield replays as episodes with observations and actions; trials in which nothing moved are left out.

    Args:
        say: Called with a sentence about each trial that is left out.
    """
    width = len(about.fields["environment_state"].names)
    for scene, episode, frames in found:
        n = len(frames.get("t_s", ())) - 1  # number of actions: one fewer than frames
        if n < 1:
            say(f"Trial {episode['seed']} is left out, as nothing moved: {episode['sentence']}.")
            continue
        # identity poses in the slots without a part
        rest = np.tile([0, 0, 0, 1, 0, 0, 0], (n + 1, (width - frames["part_poses"].shape[1]) // 7))
        done = [  # undone operations are negative
            (k or 0) * (-1 if undoes else 1) for k, undoes in zip(frames["operation"], frames["undoes"], strict=True)
        ]
        rewards = np.zeros(n)
        rewards[-1] = float(episode["success"])
        yield RecordedEpisode(
            seed=episode["seed"],
            task=f"{scene.scenario.title}: repeat what was shown.",
            observations={
                "state": np.hstack([frames["joints"], frames["fingers"]]),
                "wrench": frames["wrench"],
                "environment_state": np.hstack([frames["part_poses"], rest]),
                "operation": np.array(done, dtype=np.float64)[:, None],
            },
            actions=frames["commands"][:-1],
            rewards=rewards,
            more=episode,
        )


def _make_episode(
    settings: TrialConfig, scene: Scene, simulated: SimulatedDemonstration, row: TrialRecord, recorder: _Recorder
) -> dict[str, Any]:
    """Return the columns of one episode: record, observation, truth and plan."""
    seen = observe_demonstration(simulated, noise_of(settings, scene, simulated), settings.seed, settings.secret_seed)
    plan = recorder.plan
    return {
        **{name: row.get(name) for name in _OF_ROW},
        "parts": recorder.parts,
        "main_parts": [operation.main for operation in seen.assembly.operations],
        "observed_poses": _flatten_poses(seen.poses),
        "covariance": seen.covariance.ravel().tolist(),
        "observed": seen.observed.tolist(),
        "true_poses": _flatten_poses(simulated.layout.poses),
        "planned_poses": None if plan is None else _flatten_poses(plan.target_poses),
        "schedule": None if plan is None else [-(k + 1) if undo else k + 1 for k, undo in plan.schedule],
    }


def _flatten_poses(poses: Array) -> list[float]:
    """Return poses, (n, 4, 4), as a list of 7 n numbers."""
    return [float(x) for x in pose.pack(poses).ravel()]
