"""The usual mistakes in logs, undone: what a recording would be without each of them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.recording.camera_file import CameraFile
from apo_bench.recording.rests import Rest
from apo_bench.recording.stays import Stay, Stays

_GL = np.diag([1.0, -1.0, -1.0, 1.0])
_SAME = np.eye(4)
_AXES = tuple("".join(axes) for each in ("xyz", "XYZ") for axes in permutations(each))
"""About three different axes, fixed or moving."""


def mistakes(stays: Stays, models: Mapping[str, Array], camera: CameraFile) -> Iterator[tuple[str, Stays]]:
    """What to do about each usual mistake, and the stays that it gives.

    Mistakes in a log are made in the poses of the tracker's models, not in those of parts.
    """

    def log(change: Callable[[Array], Array]) -> Stays:
        return _changed(stays, lambda part, T: change(T @ pose.inverse(M(part))) @ M(part))

    euler = camera.conventions.euler
    X = camera.T_world_camera

    def M(part: str) -> Array:
        return models.get(part, _SAME)

    for order, shift in (("xyzw", 1), ("wxyz", -1)):
        sentence = (
            f"its quaternions seem to be in the order {order}: name their columns so, or state it in the camera file"
        )
        yield sentence, log(partial(_reordered, shift=shift))
    for axis in "xyz":
        sentence = f'its axes seem to be mirrored (left-handed): state `mirror = "{axis}"` in the camera file'
        flip = np.where(np.array(list("xyz1")) == axis, -1.0, 1.0)
        yield sentence, log(partial(_mirrored, flip=flip))
    sentence = "its poses seem to be those of the camera in the model: state `inverted = true` in the camera file"
    yield sentence, log(pose.inverse)
    if X is not None:
        sentence = "the pose in the camera file seems to be that of the world in the camera: state it inverted"
        yield sentence, log(lambda T: pose.inverse(X @ X) @ T)
    sentence = "its axes seem to be those of OpenGL: turn the pose of the camera by 180 deg about x"
    yield sentence, log(lambda T: _GL @ T)
    for factor in (10.0, 0.1, 1e3, 1e-3):
        sentence = f"its lengths seem to be {_times(factor)} those that were read: state their unit"
        yield sentence, log(partial(_scaled, factor=factor))
    sentence = "its angles seem to be radians that were read as degrees: name their columns so, or state `angle`"
    yield sentence, log(partial(_turned_more, euler=euler))
    for order in _AXES:
        if euler and order != euler:
            sentence = f'its Euler angles seem to be about other axes: state `euler = "{order}"` in the camera file'
            yield sentence, log(partial(_other_axes, stated=euler, order=order))
    yield "its time seems to run backwards: give the log as it was recorded", reversed_in_time(stays)
    if models:
        sentence = "the frames in the objects file seem to be those of the models in the parts: state them inverted"
        yield sentence, _changed(stays, lambda part, T: T @ pose.inverse(M(part) @ M(part)))


def reversed_in_time(stays: Stays) -> Stays:
    """The same, played backwards."""
    end = max(stay.ends for known in stays.values() for stay in known)
    return {
        part: tuple(
            Stay(
                part,
                tuple(replace(rest, begins=end - rest.ends, ends=end - rest.begins) for rest in reversed(stay.rests)),
            )
            for stay in reversed(known)
        )
        for part, known in stays.items()
    }


def _changed(stays: Stays, change: Callable[[str, Array], Array]) -> Stays:
    """The stays of the same parts at other poses."""

    def other(part: str, rest: Rest) -> Rest:
        return replace(rest, mean=replace(rest.mean, T=change(part, rest.T)))

    return {
        part: tuple(replace(stay, rests=tuple(other(part, rest) for rest in stay.rests)) for stay in known)
        for part, known in stays.items()
    }


def _times(factor: float) -> str:
    return f"{factor:g} times" if factor > 1.0 else f"1/{1.0 / factor:g} of"


def _reordered(T: Array, shift: int) -> Array:
    """The rotation that the same four numbers are in the other order."""
    packed = pose.pack(T)
    return np.asarray(pose.unpack(np.concatenate([packed[:3], np.roll(packed[3:], shift)])))


def _turned_more(T: Array, euler: str | None) -> Array:
    R = Rotation.from_matrix(T[:3, :3])
    if euler:
        return _with_turn(T, Rotation.from_euler(euler, np.degrees(R.as_euler(euler))))
    return _with_turn(T, Rotation.from_rotvec(np.degrees(R.as_rotvec())))


def _other_axes(T: Array, stated: str, order: str) -> Array:
    return _with_turn(T, Rotation.from_euler(order, Rotation.from_matrix(T[:3, :3]).as_euler(stated)))


def _with_turn(T: Array, R: Rotation) -> Array:
    out = np.array(T)
    out[:3, :3] = R.as_matrix()
    return out


def _mirrored(T: Array, flip: Array) -> Array:
    return T * np.outer(flip, flip)


def _scaled(T: Array, factor: float) -> Array:
    out = np.array(T)
    out[:3, 3] *= factor
    return out
