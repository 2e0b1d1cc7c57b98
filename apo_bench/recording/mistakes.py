"""The usual mistakes in logs, undone: what a recording would be without each of them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array, pose
from apo_bench.recording.rests import RestSpan
from apo_bench.recording.setup_files import CameraFile
from apo_bench.recording.stays import Stay, Stays

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
        return replace(rest, begins=end - rest.ends, ends=end - rest.begins)

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
