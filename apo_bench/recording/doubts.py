"""What is wrong with a recording that does not fit: each usual mistake is tried, and the one that mends it is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.recording.camera_pose import CameraPose
from apo_bench.recording.contact_fit import ContactFit
from apo_bench.recording.ordering import NoOrder, Order
from apo_bench.recording.rests import Rest
from apo_bench.recording.stays import Stay

Stays = Mapping[str, tuple[Stay, ...]]
_FITS_MM = 20.0
"""A contact that is open by more, or a known place that is missed by more, is no noise; degrees count like mm."""
_MENDS = 0.4
"""What mends a recording leaves at most this part of what was wrong."""


class Arrangement(NamedTuple):
    """A camera and an order, and how well they fit."""

    camera: CameraPose
    order: Order | None
    fit: ContactFit
    """The worst contact."""

    @property
    def wrong_mm(self) -> float:
        return max(self.fit.wrong_mm, self.camera.off_mm, self.camera.off_deg)


def check_arrangement(found: Arrangement, arrange: Callable[[Stays], Arrangement], stays: Stays, file: str) -> None:
    """Refuse a recording in which no contact fits, with what would mend it.

    Args:
        arrange: Says how well other stays would fit.

    Raises:
        InputError: It does not fit.
    """
    if found.wrong_mm <= _FITS_MM:
        return
    best, said = found.wrong_mm * _MENDS, ""
    for sentence, other in mistakes(stays):
        try:
            wrong = arrange(other).wrong_mm
        except (NoOrder, np.linalg.LinAlgError):
            continue
        if wrong < min(best, _FITS_MM):
            best, said = wrong, f"{sentence}; then all is within {wrong:.1f} mm"
    raise InputError(f"{file}: no contact fits as it is stated ({_wrong(found)}); {said or _HELPLESS}.")


def check_direction(arrange: Callable[[Stays], Arrangement], stays: Stays, file: str) -> None:
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


_HELPLESS = (
    "neither another order of the quaternions, mirrored axes, inverted poses, another unit nor reversed time mends it, "
    "so check the frames of the parts in the objects file, the ids, and the pose of the camera"
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


def mistakes(stays: Stays) -> Iterator[tuple[str, Stays]]:
    """What to do about each usual mistake, and the stays that it gives."""
    for order, shift in (("xyzw", 1), ("wxyz", -1)):
        sentence = (
            f"its quaternions seem to be in the order {order}: name their columns so, or state it in the camera file"
        )
        yield sentence, _changed(stays, partial(_reordered, shift=shift))
    for axis in "xyz":
        sentence = f'its axes seem to be mirrored (left-handed): state `mirror = "{axis}"` in the camera file'
        flip = np.where(np.array(list("xyz1")) == axis, -1.0, 1.0)
        yield sentence, _changed(stays, partial(_mirrored, flip=flip))
    sentence = "its poses seem to be those of the camera in the model: state `inverted = true` in the camera file"
    yield sentence, _changed(stays, pose.inverse)
    yield (
        "its axes seem to be those of OpenGL: turn the pose of the camera by 180 deg about x",
        _changed(stays, lambda T: _GL @ T),
    )
    for factor, fault in ((1e3, "metres that were read as mm"), (1e-3, "mm that were read as metres")):
        yield f"its lengths seem to be {fault}: state their unit", _changed(stays, partial(_scaled, factor=factor))
    yield "its time seems to run backwards: give the log as it was recorded", reversed_in_time(stays)


_GL = np.diag([1.0, -1.0, -1.0, 1.0])


def _wrong(found: Arrangement) -> str:
    said = [f"they are open by up to {1e3 * found.fit.gap_m:.0f} mm and {np.degrees(found.fit.angle_rad):.0f} deg"]
    if found.camera.residuals:
        said.append(f"known places are missed by up to {found.camera.off_mm:.0f} mm and {found.camera.off_deg:.0f} deg")
    return ", ".join(said)


def _changed(stays: Stays, change: Callable[[Array], Array]) -> Stays:
    def other(rest: Rest) -> Rest:
        return replace(rest, mean=replace(rest.mean, T=change(rest.T)))

    return {
        part: tuple(replace(stay, rests=tuple(map(other, stay.rests))) for stay in known)
        for part, known in stays.items()
    }


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
