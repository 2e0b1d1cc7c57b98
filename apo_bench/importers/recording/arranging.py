"""What rests give: the camera's pose, where parts start, the order of operations, and how well all of it fits."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.errors import require, unknown
from apo_bench.geometry import Array, extent, frozen, pose
from apo_bench.importers.recording.averaging import Mean
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.ordering import (
    ContactFit,
    Order,
    Stated,
    contact_fit,
    order_of,
    quiet,
    stated_order,
    world_poses,
)
from apo_bench.importers.recording.stays import Stay, Stays

_HIGH_M = 0.01
_TILTED_DEG = 10.0
"""A part that was seen so much higher or more tilted than planned stands otherwise."""
_ROUNDS = 50
_PLACED = frozen(np.repeat([2e-4, 2e-3], 3), 6)
"""How well a place is known, per axis, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class CameraPose:
    """The pose of a camera, and how it is known."""

    T_world_camera: Array
    """(4, 4), [m]."""
    residuals: Mapping[str, Array] = field(default_factory=dict)
    """Part -> (6,), the body twist from its known place to where the camera sees it; empty of a pose that was given."""
    covariance: Array | None = None
    """(6, 6), of the body twist by which the pose is wrong, [m, rad]; None of a pose that was given."""

    @property
    def off_mm(self) -> float:
        """Largest distance of a part from its known place, [mm]."""
        return max((1e3 * float(np.linalg.norm(r[:3])) for r in self.residuals.values()), default=0.0)

    @property
    def off_deg(self) -> float:
        """Largest turn of a part from its known place."""
        return max((float(np.degrees(np.linalg.norm(r[3:]))) for r in self.residuals.values()), default=0.0)


class Arrangement(NamedTuple):
    """A camera and an order, and how well they fit."""

    camera: CameraPose
    order: Order
    start: Poses
    """Of all parts, world, [m]."""
    whence: Mapping[str, str]
    """Part -> where its start is from: `known`, `seen`, `scenario`, `otherwise`, `in the hand` (as in the scenario)."""
    fits: Mapping[int, ContactFit]
    """Operation that was seen, counted from 0 -> its worst contact."""
    stays: Stays
    """From where each part stood at the start."""

    @property
    def fit(self) -> ContactFit:
        """The worst contact of all."""
        return max(self.fits.values(), key=lambda fit: fit.wrong_mm, default=ContactFit(0.0, 0.0))

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
    solved = camera_pose(stays, camera, planned, assembly.fixed)
    X = solved.T_world_camera
    standing = {part: _since_it_stands(known, assembly, planned[part], X) for part, known in stays.items()}
    begun = {part: X @ known[0].rests[0].T for part, known in standing.items() if known}
    start, whence = start_poses(begun, camera, planned)
    held = {part: "in the hand" for part in standing if part not in begun and whence[part] == "scenario"}
    stays = {part: standing[part] or known for part, known in stays.items()}
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
    return Arrangement(solved, order, start, {**whence, **held}, fits, stays)


def camera_pose(stays: Stays, camera: CameraFile, planned: Poses, fixed: Collection[str]) -> CameraPose:
    """Where the camera stands: as stated, or solved from the first rests of parts on known places.

    Args:
        fixed: Parts that nobody moves: their places may be known though they are not tracked.

    Raises:
        InputError: Neither is stated, or a known part that may move is not tracked.
    """
    for part in camera.known:
        require(part in stays or part in fixed, f"the camera file, known: {unknown('tracked part', part, stays)}")
    if camera.T_world_camera is not None:
        return CameraPose(camera.T_world_camera)
    require(
        camera.known,
        "the camera file states neither where the camera stands nor a part on a known place; add a table [pose], "
        'or [known] with parts such as castle1 = "start".',
    )
    places = {part: T for part, T in camera.places(planned).items() if part in stays}
    require(places, "the camera file states no place of a part that is tracked; add one, or a table [pose].")
    return solved_camera(stays, camera, places)


def solved_camera(stays: Stays, camera: CameraFile, places: Poses) -> CameraPose:
    """The camera's pose from the first rests of parts whose places are known, world, [m]."""
    seen = {part: stays[part][0].rests[0].mean for part in places}
    return solve_camera(places, seen, staying(camera, next(iter(seen.values()))))


def solve_camera(known: Mapping[str, Array], seen: Mapping[str, Mean], stays: Array) -> CameraPose:
    """The pose at which the parts stand on their places, by weighted least squares on SE(3).

    X exp(d) M = K exp(r): residuals r of parts seen at M and standing at K change by Ad(M^-1) d.

    Args:
        known: Part -> (4, 4), where it stands in the world, [m].
        seen: Part -> where it was seen.
        stays: (6, 6), covariance of an error of the estimator that stays, [m, rad].
    """
    parts = tuple(known)
    K = np.array([known[p] for p in parts])
    M = np.array([seen[p].T for p in parts])
    W = np.array([np.linalg.inv(seen[p].covariance + stays + np.diag(_PLACED**2)) for p in parts])
    # Normal equations of r + A d = 0, the sum of A^t W A over parts; A hardly depends on X.
    A = pose.adjoint(pose.inverse(M))
    normal = np.einsum("kji,kjl,klm->im", A, W, A)
    # Each part alone says X = K M^-1; the one that fits all of them best is where Gauss-Newton begins.
    X = min((K @ pose.inverse(M)), key=lambda X: _cost(_residuals(X, K, M), W))
    for _ in range(_ROUNDS):
        r = _residuals(X, K, M)
        step = -np.linalg.solve(normal, np.einsum("kji,kjl,kl->i", A, W, r))
        X = X @ pose.exp(step)
        if np.abs(step).max() < 1e-12:
            break
    r = _residuals(X, K, M)
    # Where residuals are larger than stated, chi-square over its degrees of freedom says how much too sure that was.
    excess = max(1.0, _cost(r, W) / max(6 * len(parts) - 6, 1)) if len(parts) > 1 else 1.0
    return CameraPose(X, MappingProxyType(dict(zip(parts, r, strict=True))), excess * np.linalg.inv(normal))


def _residuals(X: Array, K: Array, M: Array) -> Array:
    return pose.log(pose.inverse(K) @ X @ M)


def _cost(r: Array, W: Array) -> float:
    return float(np.einsum("ki,kij,kj->", r, W, r))


def staying(camera: CameraFile, mean: Mean) -> Array:
    """The covariance of an error that stays while a part rests, (6, 6); as large as that of one frame if not stated."""
    return mean.scatter if camera.stays is None else np.diag(np.repeat(camera.stays, 3) ** 2)


def _since_it_stands(known: Sequence[Stay], assembly: Assembly, planned: Array, X: Array) -> tuple[Stay, ...]:
    """The stays of a part from its start on; none if a hand held it in the air from the first frame until its goal.

    A first stay in the air is a pause of the hand, which then put the part down: where as many stays follow as there
    are operations that move the part.

    Args:
        planned: Where the scenario starts it, world, [m].
        X: The camera.
    """
    part = known[0].part
    pieces = assembly.solids[part].pieces
    lowest = planned[2, 3] + extent(pieces, planned[2, :3])[0]
    moves = sum(operation.main == part for operation in assembly.operations)
    for i in range(max(1, len(known) - moves)):
        T = X @ known[i].rests[0].T
        if part in assembly.fixed or T[2, 3] + extent(pieces, T[2, :3])[0] <= lowest + _HIGH_M:
            return tuple(known[i:])
    return ()


def start_poses(seen: Poses, camera: CameraFile, planned: Poses) -> tuple[Poses, Mapping[str, str]]:
    """Where every part starts, and whence that is known: `known`, `seen`, `otherwise` or `scenario`.

    Args:
        seen: Of tracked parts, world, [m].
        planned: Of all parts.
    """
    known = camera.places(planned)
    standing = {part: _standing(planned[part], T) for part, T in seen.items() if part not in known}
    stood = {part: T for part, T in standing.items() if T is not None}
    whence = {
        **dict.fromkeys(planned, "scenario"),
        **dict.fromkeys(standing, "otherwise"),
        **dict.fromkeys(stood, "seen"),
        **dict.fromkeys(known, "known"),
    }
    return {**planned, **seen, **stood, **known}, whence


def _standing(planned: Array, seen: Array) -> Array | None:
    """Place and turn on the table as seen, height and tilt as planned, (4, 4); None if it stood otherwise."""
    # Of all turns about z the one nearest to R maximises trace(Rz^t R), which is at this angle.
    R = seen[:3, :3] @ planned[:3, :3].T
    turn = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
    T = np.array(pose.at((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ planned)
    T[:3, 3] = (*seen[:2, 3], planned[2, 3])
    off = pose.log(pose.inverse(T) @ seen)
    is_high = abs(seen[2, 3] - planned[2, 3]) > _HIGH_M
    return None if is_high or np.degrees(np.linalg.norm(off[3:])) > _TILTED_DEG else T
