"""What is wrong with a recording that does not fit: each usual mistake is tried, and the one that mends it is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.recording.arranging import Arrange, Arrangement
from apo_bench.recording.ordering import NoOrder
from apo_bench.recording.rests import Rest
from apo_bench.recording.stays import Stay, Stays

_FITS_MM = 20.0
"""A contact that is open by more, or a known place that is missed by more, is no noise; degrees count like mm."""
_MENDS = 0.4
"""What mends a recording leaves at most this part of what was wrong."""
_HELPLESS = (
    "neither another order of the quaternions, mirrored axes, inverted poses, another unit nor reversed time mends it, "
    "so check the frames of the parts in the objects file, the ids, the pose of the camera, and that the log goes on "
    "until the last part was put down"
)


def check_arrangement(
    found: Arrangement, arrange: Arrange, stays: Stays, models: Mapping[str, Array], file: str
) -> None:
    """Refuse a recording in which no contact fits, with what would mend it.

    Args:
        models: Part -> where its frame lies in the tracker's model, (4, 4), [m]; the identity if it is missing.

    Raises:
        InputError: It does not fit.
    """
    if found.wrong_mm <= _FITS_MM:
        return
    best, said = found.wrong_mm * _MENDS, ""
    for sentence, other in mistakes(stays, models):
        try:
            wrong = arrange(other).wrong_mm
        except (NoOrder, np.linalg.LinAlgError):
            continue
        if wrong < min(best, _FITS_MM):
            best, said = wrong, f"{sentence}; then all is within {wrong:.1f} mm"
    raise InputError(f"{file}: no contact fits as it is stated ({_wrong(found)}); {said or _HELPLESS}.")


def check_direction(arrange: Arrange, stays: Stays, file: str) -> None:
    """Refuse a recording that is played backwards.

    Raises:
        InputError: Played the other way it has the operations of the scenario, and contacts fit.
    """
    try:
        wrong = arrange(reversed_in_time(stays)).wrong_mm
    except NoOrder:
        return
    if wrong < _FITS_MM:
        raise InputError(
            f"{file}: time seems to run backwards: played the other way, all is within {wrong:.1f} mm of the scenario; "
            "give the log as it was recorded."
        )


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


def mistakes(stays: Stays, models: Mapping[str, Array]) -> Iterator[tuple[str, Stays]]:
    """What to do about each usual mistake, and the stays that it gives.

    Mistakes in a log are made in the poses of the tracker's models, not in those of parts.
    """

    def log(change: Callable[[Array], Array]) -> Stays:
        return _changed(stays, lambda part, T: change(T @ pose.inverse(M(part))) @ M(part))

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
    sentence = "its axes seem to be those of OpenGL: turn the pose of the camera by 180 deg about x"
    yield sentence, log(lambda T: _GL @ T)
    for factor in (10.0, 0.1, 1e3, 1e-3):
        sentence = f"its lengths seem to be {_times(factor)} those that were read: state their unit"
        yield sentence, log(partial(_scaled, factor=factor))
    yield "its time seems to run backwards: give the log as it was recorded", reversed_in_time(stays)
    if models:
        sentence = "the frames in the objects file seem to be those of the models in the parts: state them inverted"
        yield sentence, _changed(stays, lambda part, T: T @ pose.inverse(M(part) @ M(part)))


_GL, _SAME = np.diag([1.0, -1.0, -1.0, 1.0]), np.eye(4)


def _wrong(found: Arrangement) -> str:
    said = [f"they are open by up to {1e3 * found.fit.gap_m:.0f} mm and {np.degrees(found.fit.angle_rad):.0f} deg"]
    if found.camera.residuals:
        said.append(f"known places are missed by up to {found.camera.off_mm:.0f} mm and {found.camera.off_deg:.0f} deg")
    return ", ".join(said)


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


def _mirrored(T: Array, flip: Array) -> Array:
    return T * np.outer(flip, flip)


def _scaled(T: Array, factor: float) -> Array:
    out = np.array(T)
    out[:3, 3] *= factor
    return out
