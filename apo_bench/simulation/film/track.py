"""Record a demonstration or a replay moment by moment."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import Plan, Poses, compute_placements
from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.simulation.hooks import Hooks, Phase
from apo_bench.simulation.scene import Scene, World, make_initial_state, move_arm_home, place_for_picture, set_part_pose

_NO_HANDS = copy_frozen(np.zeros((0, 3)), None, 3)
_IN_PLACE = "in place"  # phase of a segment that only shows a scenario


class FilmMoment(NamedTuple):
    """One recorded state of a world, with its phase."""

    time_s: float
    qpos: Array
    phase: Phase
    hands: Array
    """Positions of the human hands, (2, 3), world frame, [m]; (0, 3) in a replay."""


@final
@dataclass(frozen=True, eq=False)
class Segment:
    """A demonstration or a replay from its beginning to its end."""

    title: str
    world: World
    start: Poses
    """Poses of all parts before the first moment; fixed parts stay there."""
    moments: tuple[FilmMoment, ...]
    ending: str
    """The outcome, in a sentence."""
    good: bool | None
    """Whether the outcome is a success; None without a verdict."""


@final
@dataclass(eq=False)
class FilmTrack:
    """Records a demonstration or a replay: pass its `hooks` as `watch`."""

    plan: Plan | None = None
    """The replayed plan; None in a demonstration."""
    moments: list[FilmMoment] = field(default_factory=list)

    @property
    def hooks(self) -> Hooks:
        return Hooks(before_replay=self._begin, after_tick=self._keep)

    def _begin(self, plan: Plan) -> None:
        self.plan = plan

    def _keep(self, data: Any, phase: Phase) -> None:
        self.moments.append(FilmMoment(float(data.time), np.array(data.qpos), phase, np.array(data.mocap_pos)))


def scenario_segment(scene: Scene, start: Poses, goals: Array) -> Segment:
    """The nominal assembly of a scenario: one moment before the first operation and one after each, 1 s apart."""
    world = scene.work
    data = make_initial_state(world, start)
    moments = list[FilmMoment]()
    move_arm_home(scene, data)
    # k = -1: before the first operation.
    for k, poses in enumerate((start, *compute_placements(scene.scenario.assembly, start, goals)), start=-1):
        for part in world.free:
            set_part_pose(world, data, part, poses[part])
        phase = Phase(None if k < 0 else k, _IN_PLACE, 0.0)
        moments.append(FilmMoment(k + 1.0, np.array(data.qpos), phase, _NO_HANDS))
    return Segment(f"{scene.scenario.name}: as the scenario states it", world, start, tuple(moments), "", None)


def read_part_poses(segment: Segment, moment: FilmMoment) -> Poses:
    """The poses of all parts at a moment, world frame, [m]."""
    free = {part: pose.unpack(moment.qpos[a : a + 7]) for part, a in segment.world.qpos.items()}
    return {**{part: segment.start[part] for part in segment.world.fixed}, **free}


def show_moment(scene: Scene, data: Any, segment: Segment, moment: FilmMoment) -> None:
    """Set a state of the replay world to a moment; for a moment of a demonstration the arm is at home."""
    if segment.world is scene.work:
        data.qpos[:] = moment.qpos
    else:
        move_arm_home(scene, data)
        for part, T in read_part_poses(segment, moment).items():
            if part in scene.work.qpos:
                set_part_pose(scene.work, data, part, T)
    place_for_picture(scene.work.model, data)
