"""What rests give: the camera's pose, where parts start, the order of operations, and how well all of it fits."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.errors import InputError, unknown
from apo_bench.geometry import Array, pose
from apo_bench.recording.averaging import Mean
from apo_bench.recording.camera_file import CameraFile
from apo_bench.recording.camera_pose import CameraPose, solve_camera
from apo_bench.recording.contact_fit import ContactFit, contact_fit
from apo_bench.recording.ordering import Order, Stated, order_of, quiet, stated_order, world_poses
from apo_bench.recording.stays import Stays

_CLOSED = ContactFit(0.0, 0.0)
_HIGH_M = 0.01
_TILTED_DEG = 10.0
"""A part that was seen so much higher or more tilted than planned stands otherwise."""


class Arrangement(NamedTuple):
    """A camera and an order, and how well they fit."""

    camera: CameraPose
    order: Order
    start: Poses
    """Of all parts, world, [m]."""
    whence: Mapping[str, str]
    """Part -> where its start is from: `known`, `seen`, `scenario`, `otherwise`."""
    fits: Mapping[int, ContactFit]
    """Operation that was seen, counted from 0 -> its worst contact."""

    @property
    def fit(self) -> ContactFit:
        """The worst contact of all."""
        return max(self.fits.values(), key=lambda fit: fit.wrong_mm, default=_CLOSED)

    @property
    def wrong_mm(self) -> float:
        return max(self.fit.wrong_mm, self.camera.off_mm, self.camera.off_deg)


Arrange = Callable[[Stays], Arrangement]
"""Says how well stays fit."""


def arrangement_of(stays: Stays, camera: CameraFile, assembly: Assembly, planned: Poses, stated: Stated) -> Arrangement:
    """The camera's pose and the order that these stays give.

    Args:
        planned: Where the scenario starts every part, world, [m].

    Raises:
        NoOrder: The moves are not the operations.
        InputError: Nothing says where the camera stands.
    """
    solved = camera_pose(stays, camera, planned)
    X = solved.T_world_camera
    start, whence = start_poses({part: X @ known[0].rests[0].T for part, known in stays.items()}, camera.known, planned)
    order = (
        stated_order(assembly, stays, stated.ends)
        if stated.ends
        else order_of(assembly, stays, start, X, stated.unseen)
    )
    fits = {
        k: contact_fit(assembly, k, world_poses(stays, quiet(assembly, stays, order.stays, k), start, X))
        for k, stay in enumerate(order.stays)
        if stay is not None
    }
    return Arrangement(solved, order, start, whence, fits)


def camera_pose(stays: Stays, camera: CameraFile, planned: Poses) -> CameraPose:
    """Where the camera stands: as stated, or solved from the first rests of parts on known places.

    Raises:
        InputError: Neither is stated, or a known part is not tracked.
    """
    if camera.T_world_camera is not None:
        return CameraPose(camera.T_world_camera)
    if not camera.known:
        raise InputError(
            "the camera file states neither where the camera stands nor a part on a known place; add a table [pose], "
            'or [known] with parts such as castle1 = "start".'
        )
    for part in camera.known:
        if part not in stays:
            raise InputError(f"the camera file, known: {unknown('tracked part', part, stays)}")
    return solved_camera(stays, camera, {part: planned[part] if T is None else T for part, T in camera.known.items()})


def solved_camera(stays: Stays, camera: CameraFile, places: Poses) -> CameraPose:
    """The camera's pose from the first rests of parts whose places are known, world, [m]."""
    seen = {part: stays[part][0].rests[0].mean for part in places}
    return solve_camera(places, seen, staying(camera, next(iter(seen.values()))))


def staying(camera: CameraFile, mean: Mean) -> Array:
    """The covariance of an error that stays while a part rests, (6, 6); as large as that of one frame if not stated."""
    return mean.scatter if camera.stays is None else np.diag(np.repeat(camera.stays, 3) ** 2)


def start_poses(seen: Poses, known: Mapping[str, Array | None], planned: Poses) -> tuple[Poses, Mapping[str, str]]:
    """Where every part starts, and whence that is known: `known`, `seen`, `otherwise` or `scenario`.

    Args:
        seen: Of tracked parts, world, [m].
        known: Places that were stated; None: as planned.
        planned: Of all parts.
    """
    start = dict(planned)
    whence = dict.fromkeys(planned, "scenario")
    for part, T in seen.items():
        if part in known:
            place = known[part]
            start[part] = planned[part] if place is None else place
            whence[part] = "known"
            continue
        standing = _standing(planned[part], T)
        start[part] = T if standing is None else standing
        whence[part] = "otherwise" if standing is None else "seen"
    return start, whence


def _standing(planned: Array, seen: Array) -> Array | None:
    """Place and turn on the table as seen, height and tilt as planned, (4, 4); None if it stood otherwise."""
    # Of all turns about z the one nearest to R maximises trace(Rz^t R), which is at this angle.
    R = seen[:3, :3] @ planned[:3, :3].T
    turn = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
    T = np.array(pose.at((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ planned)
    T[:2, 3] = seen[:2, 3]
    T[2, 3] = planned[2, 3]
    off = pose.log(pose.inverse(T) @ seen)
    if abs(seen[2, 3] - planned[2, 3]) > _HIGH_M or np.degrees(np.linalg.norm(off[3:])) > _TILTED_DEG:
        return None
    return T
