"""Whole trials as tables, with a card: what was seen, planned and true, and every replay, frame by frame."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, final

import numpy as np

from apo_bench import __version__
from apo_bench.assembly import Plan
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.io.ordinary_files import to_write
from apo_bench.io.tables import write_columns
from apo_bench.records import Row, TrialSettings
from apo_bench.simulation.hooks import TICK_S, Doing, Hooks
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import part_pose
from apo_bench.trial.stages import SimulatedDemonstration, observe_demonstration, scene_of, simulate_demonstration
from apo_bench.trial.trial import noise_of, run_trial

_EVERY = 2
"""Of the ticks of a replay every second one is a frame."""
FRAMES_A_SECOND = 1.0 / (_EVERY * TICK_S)
_OF_ROW = MappingProxyType(
    {
        "scenario": "the assembly",
        "seed": "number of the trial",
        "method": "what made the plan",
        "noise": "model of the camera",
        "level": "of the noise, mm",
        "level_deg": "of the noise, degrees",
        "careless": "0 for a careful human, 1 for the scenario's",
        "success": "whether the assembly is right at the end; the judge's word",
        "as_demonstrated": "whether each contact was also made when and where it was shown",
        "failure_stage": "where it failed; null if it did not",
        "failure_code": "how it failed",
        "failure_operation": "which operation failed, from 1",
        "sentence": "the same in words",
        "sim_seconds": "simulated time of the replay, s",
        "spec_hash": "of everything that this trial depends on",
    }
)
_POSES = "(x, y, z, qw, qx, qy, qz), world frame, m"
EPISODES: Mapping[str, str] = MappingProxyType(
    {
        "episode": "from 0; its frames are in frames/EPISODE.parquet, if it was replayed",
        **_OF_ROW,
        "parts": "names of the parts that can move, in the order of the frames",
        "main_parts": "the part that each of the n operations moves",
        "seen_goals": f"7 n numbers: where each part was seen after its operation, {_POSES}",
        "covariance": "36 n numbers: of the twist by which each seen goal may be wrong, frame of the part, m and rad",
        "seen": "n: whether the operation was seen at all",
        "true_goals": f"7 n numbers: the goals at which all contacts hold, {_POSES}",
        "planned_goals": f"7 n numbers: where the plan puts each part in the end, {_POSES}; null without a plan",
        "schedule": "what the plan does: k for operation k, -k where it undoes it, from 1",
        "frames": "how many frames there are",
    }
)
"""Column of episodes.parquet -> what it is."""
FRAMES: Mapping[str, str] = MappingProxyType(
    {
        "episode": "as above",
        "t_s": "simulated time, s",
        "operation": "the operation that is done, from 1; null before the first",
        "undoes": "whether it is undone",
        "macro": "the macros of the motion, or the stage where it is none",
        "force_n": "contact force on what is held, at the wrist, N; 0 with an empty hand",
        "joints": "positions of the arm's joints, rad or m",
        "fingers": "positions of the fingers, m; 0 is closed",
        "part_poses": f"7 numbers for each of `parts`: {_POSES}",
    }
)
"""Column of the tables of frames -> what it is."""


@final
class _Recorder:
    """Looks on at a replay."""

    def __init__(self, scene: Scene, episode: int) -> None:
        self.plan: Plan | None = None
        self.parts = sorted(scene.work.free)
        self.columns: dict[str, list[Any]] = {name: [] for name in FRAMES}
        self._scene = scene
        self._episode = episode
        self._ticks = 0

    def hooks(self) -> Hooks:
        return Hooks(before_replay=self._planned, after_tick=self._tick)

    def _planned(self, plan: Plan) -> None:
        self.plan = plan

    def _tick(self, data: Any, doing: Doing) -> None:
        self._ticks += 1
        if self._ticks % _EVERY:
            return
        arm = self._scene.arm
        at = [part_pose(self._scene.work, data, part) for part in self.parts]
        frame = (
            self._episode,
            float(data.time),
            None if doing.operation is None else doing.operation + 1,
            doing.undoes,
            doing.macro,
            float(doing.force_n),
            [float(data.joint(f"arm/{joint}").qpos[0]) for joint in arm.joints],
            [float(data.joint(f"arm/{finger}").qpos[0]) for finger in arm.fingers],
            _flat(np.array(at)),
        )
        for column, entry in zip(self.columns.values(), frame, strict=True):
            column.append(entry)


def make_dataset(trials: Iterable[TrialSettings], out: Path, command: str) -> tuple[int, int]:
    """Run trials and write them as Parquet, with a card `README.md`.

    The same trials give the same tables on one machine.

    Args:
        out: A folder that is not there yet, or is empty.
        command: What the card says it was made by.

    Returns:
        How many trials there are, and how many of them are right.

    Raises:
        InputError: The folder holds something, or a trial cannot be run.
        OSError: Something cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"'{out}' is there already and not an empty folder; name another.")
    (out / "frames").mkdir(parents=True)
    episodes = []
    scene = None
    arms: dict[str, str] = {}
    for k, settings in enumerate(trials):
        if scene is None or episodes[-1]["scenario"] != settings.scenario:
            scene = scene_of(settings)
        arms[str(settings.arm)] = ", ".join((*scene.arm.joints, *scene.arm.fingers))
        recorder = _Recorder(scene, k)
        simulated = simulate_demonstration(scene, settings.careless, settings.seed, settings.eye, settings.salt)
        row = run_trial(settings, scene, simulated=simulated, watch=recorder.hooks())
        episodes.append(_episode(settings, scene, simulated, row, recorder))
        if recorder.columns["t_s"]:
            write_columns([*FRAMES], [*recorder.columns.values()], out / "frames" / f"{k:06}.parquet")
    write_columns([*EPISODES], [[each[name] for each in episodes] for name in EPISODES], out / "episodes.parquet")
    right = sum(bool(each["success"]) for each in episodes)
    with to_write(out / "README.md", "w") as card:
        card.write(_card(len(episodes), right, arms, command))
    return len(episodes), right


def _episode(
    settings: TrialSettings, scene: Scene, simulated: SimulatedDemonstration, row: Row, recorder: _Recorder
) -> dict[str, Any]:
    """One line of the table of episodes."""
    seen = observe_demonstration(simulated, noise_of(settings, scene, simulated), settings.seed, settings.salt)
    plan = recorder.plan
    return {
        "episode": recorder._episode,
        **{name: row.get(name) for name in _OF_ROW},
        "parts": recorder.parts,
        "main_parts": [operation.main for operation in seen.assembly.operations],
        "seen_goals": _flat(seen.goals),
        "covariance": seen.covariance.ravel().tolist(),
        "seen": seen.seen.tolist(),
        "true_goals": _flat(simulated.layout.goals),
        "planned_goals": None if plan is None else _flat(plan.goals),
        "schedule": None if plan is None else [-(k + 1) if undo else k + 1 for k, undo in plan.schedule],
        "frames": len(recorder.columns["t_s"]),
    }


def _flat(poses: Array) -> list[float]:
    return [float(x) for x in pose.pack(poses).ravel()]


def _card(episodes: int, right: int, arms: Mapping[str, str], command: str) -> str:
    """What the data are, for whoever finds them."""
    tables = {"episodes.parquet, one line each": EPISODES, "frames/*.parquet, one line a frame": FRAMES}
    lines = [
        "# Assemblies that a robot repeats",
        "",
        f"{episodes} simulated trials, {right} of them right, made by apo_bench {__version__} with MuJoCo:",
        "",
        f"    {command}",
        "",
        "A human assembles parts, a camera sees with an error where each was put, a method plans, a robot arm replays,",
        "and a judge looks at physics alone. Nothing was measured on a real robot. `seed` is the number of a trial of",
        f"`apo-bench replay`, which runs it again. Frames are about {FRAMES_A_SECOND:g} a second of simulated time.",
        "",
        *(
            f"Joints and fingers of the arm `{name}`, in the order of the frames: {joints}."
            for name, joints in arms.items()
        ),
        "",
        "Licence: Apache-2.0, as that of apo_bench.",
    ]
    for title, columns in tables.items():
        lines += ["", f"## {title}", "", "| column | what it is |", "|---|---|"]
        lines += [f"| `{name}` | {meaning} |" for name, meaning in columns.items()]
    return "\n".join(lines) + "\n"
