"""Where a part stays: rests between which it is only adjusted are one stay, and what it does between two is a move.

Hands and grippers in view: what takes a part along and then leaves it is no part.

The usual mistakes in logs, undone: what a recording would be without each of them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, permutations
from typing import final

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array, Solid, nearest_alike, pose
from apo_bench.recording.rests import RestSpan, consecutive, rests_of
from apo_bench.recording.setup_files import CameraFile, Log, ObjectsFile, PoseTrack

_ADJUSTED_M = 0.01
_ADJUSTED_RAD = np.radians(10.0)
"""A rest that is nearer to the one before is the same stay."""
_ADJUSTED_S = 1.5
"""Longest time of such an adjustment."""


@final
@dataclass(frozen=True, eq=False)
class Stay:
    """A part at one place, adjusted or not."""

    part: str
    rests: tuple[RestSpan, ...]

    @property
    def begins(self) -> float:
        return self.rests[0].begins

    @property
    def ends(self) -> float:
        return self.rests[-1].ends

    @property
    def gone(self) -> float:
        """When the part may have been there last: until it was seen again, if it was hidden."""
        return self.rests[-1].gone

    @property
    def seconds(self) -> float:
        return sum(rest.seconds for rest in self.rests)

    def at(self, t: float) -> RestSpan:
        """The rest at a time, else the last one before it."""
        return next((rest for rest in reversed(self.rests) if rest.begins <= t), self.rests[0])


Stays = Mapping[str, tuple[Stay, ...]]
"""Part -> where it stayed, in order of time."""


def all_stays(tracks: Mapping[str, PoseTrack]) -> Stays:
    """Where every part of a log stayed; nowhere, if it never rests."""
    return {part: stays_of(part, rests_of(track)) for part, track in tracks.items()}


def stays_of(part: str, rests: Sequence[RestSpan]) -> tuple[Stay, ...]:
    """The stays of a part, in order of time."""
    groups = consecutive(rests, lambda before, rest: _is_adjusted(before[-1], rest))
    return tuple(Stay(part, tuple(together)) for together in groups)


def poses_at(stays: Stays, t: float) -> Mapping[str, Array]:
    """Where every part is at a time, in the frame of the camera: of one that moves, where it was last; (4, 4), [m]."""
    return {
        part: next((stay for stay in reversed(known) if stay.begins <= t), known[0]).at(t).T
        for part, known in stays.items()
        if known
    }


def _is_adjusted(before: RestSpan, after: RestSpan) -> bool:
    off = pose.log(pose.inverse(before.T) @ after.T)
    return is_near(off) and after.begins - before.gone < _ADJUSTED_S


def is_near(twist: Array) -> bool:
    """Whether a part that moves by a body twist (6,) is only adjusted."""
    return bool(np.linalg.norm(twist[:3]) < _ADJUSTED_M and np.linalg.norm(twist[3:]) < _ADJUSTED_RAD)


def is_flip(solid: Solid, twist: Array) -> bool:
    """Whether a part that moves by a body twist (6,) is where it was, but turned by one of its symmetries."""
    alike = nearest_alike(solid, np.asarray(pose.exp(twist)), np.eye(4))
    return is_near(pose.log(alike)) and not is_near(twist)


def flip_time(solid: Solid, known: Sequence[Stay]) -> float | None:
    """When a part is seen flipped by one of its symmetries, with nothing between, [s]; None if it never is."""
    return next(
        (
            after.begins
            for before, after in pairwise(known)
            if is_flip(solid, pose.log(pose.inverse(before.rests[-1].T) @ after.rests[0].T))
        ),
        None,
    )


_FAR_M = 0.03
"""A part that goes less far was not carried; a hand that goes less far did not leave."""
_TOGETHER_M = 0.01
_TOGETHER_RAD = np.radians(15.0)
"""What is held moves in the hand by less, beside noise."""
_FEWEST = 5
"""Frames that both have on the way."""


def hands_of(log: Log, objects: ObjectsFile) -> Mapping[str, str]:
    """Ids that no part is named for and that move as a hand does -> a part that it took along.

    A hand goes the way of a part with it, and away from it while the part rests there. A part that is carried upon
    another one stays with it.
    """
    named = {tracked.id: part for part, tracked in objects.parts.items()}
    strange = [name for name in log.tracks if name not in named and name not in objects.ignored]
    stays = {name: stays_of(name, rests_of(log.tracks[name])) for name in named if strange and name in log.tracks}
    return {
        hand: part
        for hand in strange
        for part in [next((named[name] for name, own in stays.items() if _took(log, hand, name, own)), None)]
        if part is not None
    }


def _took(log: Log, hand: str, part: str, stays: tuple[Stay, ...]) -> bool:
    """Whether something took a part from one stay to the next and went away."""
    for before, after in pairwise(stays):
        t, held = _held(log.tracks[hand], log.tracks[part])
        way = after.rests[0].T[:3, 3] - before.rests[-1].T[:3, 3]
        # the first and last fifth of the way belong to taking and putting down
        edge = 0.2 * (after.begins - before.ends)
        on_way = held[(t > before.ends + edge) & (t < after.begins - edge)]
        if len(on_way) < _FEWEST or np.linalg.norm(way) < _FAR_M:
            continue
        off = pose.log(pose.inverse(on_way[len(on_way) // 2]) @ on_way)
        together = (np.linalg.norm(off[:, :3], axis=1) < _TOGETHER_M) & (
            np.linalg.norm(off[:, 3:], axis=1) < _TOGETHER_RAD
        )
        left = held[(t > after.begins) & (t < after.ends)]
        away = np.linalg.norm(left[:, :3, 3] - on_way[-1][:3, 3], axis=1) > _FAR_M
        if together.mean() > 0.9 and away.any():
            return True
    return False


def _held(hand: PoseTrack, part: PoseTrack) -> tuple[Array, Array]:
    """Times of frames in which both were seen, (n,), and the hand in the frame of the part then, (n, 4, 4)."""
    at = np.clip(np.searchsorted(part.t, hand.t), 1, len(part.t) - 1)
    nearest = at - (hand.t - part.t[at - 1] < part.t[at] - hand.t)
    both = np.abs(part.t[nearest] - hand.t) < np.median(np.diff(part.t))
    return hand.t[both], pose.inverse(part.T[nearest[both]]) @ hand.T[both]


_EULER_AXES = tuple("".join(axes) for each in ("xyz", "XYZ") for axes in permutations(each))
"""About three different axes, fixed or moving."""


def mistakes(stays: Stays, models: Mapping[str, Array], camera: CameraFile) -> Iterator[tuple[str, Stays]]:
    """What to do about each usual mistake, and the stays that it gives.

    Mistakes in a log are made in the poses of the tracker's models, not in those of parts.
    """
    for sentence, undone in _in_the_log(camera):
        yield sentence, _changed(stays, models, partial(_of_model, undone=undone))
    yield "its time seems to run backwards: give the log as it was recorded", reversed_in_time(stays)
    if models:
        yield (
            "the frames in the objects file seem to be those of the models in the parts: state them inverted",
            _changed(stays, models, lambda T, M: T @ pose.inverse(M @ M)),
        )


def _in_the_log(camera: CameraFile) -> Iterator[tuple[str, Callable[[Array], Array]]]:
    """What to do about each mistake in poses (4, 4) of models, and what makes the right ones of them."""
    for order, shift in (("xyzw", 1), ("wxyz", -1)):
        yield (
            f"its quaternions seem to be in the order {order}: name their columns so, or state it in the camera file",
            partial(_reordered, shift=shift),
        )
    for axis in "xyz":
        flip = np.where(np.array(list("xyz1")) == axis, -1.0, 1.0)
        yield (
            f'its axes seem to be mirrored (left-handed): state `mirror = "{axis}"` in the camera file',
            partial(np.multiply, np.outer(flip, flip)),
        )
    yield (
        "its poses seem to be those of the camera in the model: state `inverted = true` in the camera file",
        pose.inverse,
    )
    X = camera.T_world_camera
    if X is not None:
        # World from part was taken for X T where it is X^-1 T: so X^-2 T in place of T.
        yield (
            "the pose in the camera file seems to be that of the world in the camera: state it inverted",
            partial(np.matmul, pose.inverse(X @ X)),
        )
    yield (
        "its axes seem to be those of OpenGL: turn the pose of the camera by 180 deg about x",
        partial(np.matmul, np.diag([1.0, -1.0, -1.0, 1.0])),
    )
    for factor in (10.0, 0.1, 1e3, 1e-3):
        times = f"{factor:g} times" if factor > 1.0 else f"1/{1.0 / factor:g} of"
        scale = np.ones((4, 4))
        scale[:3, 3] = factor
        yield f"its lengths seem to be {times} those that were read: state their unit", partial(np.multiply, scale)
    euler = camera.conventions.euler
    yield (
        "its angles seem to be radians that were read as degrees: name their columns so, or state `angle`",
        partial(_turned, change=partial(_turned_more, euler=euler)),
    )
    for order in _EULER_AXES:
        if euler and order != euler:
            yield (
                f'its Euler angles seem to be about other axes: state `euler = "{order}"` in the camera file',
                partial(_turned, change=partial(_about_other_axes, stated=euler, order=order)),
            )


def reversed_in_time(stays: Stays) -> Stays:
    """The same, played backwards."""
    end = max(stay.ends for known in stays.values() for stay in known)

    def backwards(rest: RestSpan) -> RestSpan:
        return replace(rest, begins=end - rest.gone, ends=end - rest.begins, gone=end - rest.begins)

    return {
        part: tuple(Stay(part, tuple(map(backwards, reversed(stay.rests)))) for stay in reversed(known))
        for part, known in stays.items()
    }


def _changed(stays: Stays, models: Mapping[str, Array], change: Callable[[Array, Array], Array]) -> Stays:
    """The stays of the same parts at other poses, which change says from a pose and the frame of its part, (4, 4)."""

    def other(part: str, rest: RestSpan) -> RestSpan:
        return replace(rest, mean=replace(rest.mean, T=change(rest.T, models.get(part, np.eye(4)))))

    return {
        part: tuple(replace(stay, rests=tuple(other(part, rest) for rest in stay.rests)) for stay in known)
        for part, known in stays.items()
    }


def _of_model(T: Array, M: Array, undone: Callable[[Array], Array]) -> Array:
    """The pose of a part whose frame lies at M in its model, once the mistake in the pose of the model is undone."""
    return undone(T @ pose.inverse(M)) @ M


def _reordered(T: Array, shift: int) -> Array:
    """The rotation that the same four numbers are in the other order."""
    packed = pose.pack(T)
    return np.asarray(pose.unpack(np.concatenate([packed[:3], np.roll(packed[3:], shift)])))


def _turned(T: Array, change: Callable[[Rotation], Rotation]) -> Array:
    out = np.array(T)
    out[:3, :3] = change(Rotation.from_matrix(T[:3, :3])).as_matrix()
    return out


def _about_other_axes(R: Rotation, stated: str, order: str) -> Rotation:
    return Rotation.from_euler(order, R.as_euler(stated))


def _turned_more(R: Rotation, euler: str | None) -> Rotation:
    """The rotation of angles that are as many radians as they were degrees."""
    if euler:
        return Rotation.from_euler(euler, np.degrees(R.as_euler(euler)))
    return Rotation.from_rotvec(np.degrees(R.as_rotvec()))
