"""Follow a demonstration through its range images: detect which part each operation moved, and to which pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import (
    Array,
    find_least_rotated_pose,
    find_nearest_symmetric_pose,
    find_symmetries,
    pose,
    shrink_pieces,
)
from apo_bench.perception.depth_camera.change_detection import Regions, find_changed_regions
from apo_bench.perception.depth_camera.model_localisation import (
    EQUAL_SHARES,
    Appearance,
    LocatedModel,
    Model,
    compare_models,
    locate_model,
)
from apo_bench.perception.depth_camera.range_finder import BIAS, VIEWS, PinholeView
from apo_bench.perception.depth_camera.ray_caster import RayCaster
from apo_bench.perception.depth_camera.surface import Surface, join_surfaces, sample_surface

_VANISHED_SHARE = 0.5
"""A part has moved if at least this fraction of its visible pixels has vanished."""
_GRID_PX = 3
"""Every third pixel of every third row is looked up."""


@final
@dataclass(frozen=True, eq=False)
class DetectedOperation:
    """One operation as measured by the range finder."""

    first: int
    """Index of the image before it."""
    last: int
    """Index of the image after it."""
    regions: tuple[Regions, ...]
    """Changed regions per view."""
    moved: frozenset[str]
    """The parts that left their place."""
    explained: Mapping[str, float]
    """Name of a model -> fraction of the change that it explains, 0 to 1."""
    found: LocatedModel | None
    """The main part at its new pose; None if it was not recognised."""
    model: Model | None
    """The fitted model of the moved parts; None if no expected operation moves these parts."""
    operation: int | None
    """The operation, counted from 0; None if no expected operation moves these parts."""


@final
@dataclass(frozen=True, eq=False)
class SensorPriors:
    """Prior knowledge of the sensor: topology, part models, start poses and planned rotations."""

    assembly: Assembly
    start: Poses
    turns: Array
    """(n, 3, 3), planned rotation of each target pose; a common rotation is estimated from the first located part."""
    play_m: float = 0.0
    """Clearance per side, by which the models are smaller, like the parts that are made."""


def follow_demonstration(
    images: Sequence[Array], noise_m: float, expected: SensorPriors, cast: RayCaster
) -> tuple[DetectedOperation, ...]:
    """Detect the operations in range images and locate the part that each one moved.

    An operation ends at the last image before different parts move, so that the hand may pause in between. Only
    manipulated parts are located: other parts that moved by less than a pixel or two keep their pose. Of consecutive
    operations that move the same parts only the last is observed, since a pause of the hand looks like an end.

    Args:
        images: (views, height, width) each, measured distances, [m]: before the demonstration, then one per pause.
        noise_m: Standard deviation of one ray.

    Returns:
        One event per detected operation, in order.
    """
    assembly = expected.assembly
    estimated_poses = {part: expected.start[part] for part in assembly.solids}
    surfaces = {
        part: sample_surface(shrink_pieces(solid, expected.play_m))
        for part, solid in assembly.solids.items()
        if part not in assembly.fixed
    }
    operations: list[DetectedOperation] = []
    frame = np.eye(3)
    k = 0
    first = 0
    while first + 1 < len(images) and k < len(assembly):
        owners = [_render_part_indices(view, estimated_poses, cast) for view in VIEWS]
        spell = _find_end_of_operation(images, first, noise_m, assembly, k, owners)
        if spell is None:
            break
        last, which, compared, moved = spell
        appearance = Appearance(VIEWS, images[last], [r.appeared for r in compared], noise_m, BIAS * noise_m, cast)
        group = None if which is None else _model_of_moved_parts(assembly, surfaces, estimated_poses, which)
        shares, located = _find_moved_model(expected, surfaces, group, which, appearance)
        if which is not None and located is not None:
            operation = assembly.operations[which]
            solid = assembly.solids[operation.main]
            # Of the poses that look the same, report the one nearest to the planned rotation.
            turn = frame @ expected.turns[which]
            T = find_least_rotated_pose(
                solid, find_nearest_symmetric_pose(located.T, find_symmetries(solid), turn), turn
            )
            if not any(detected.found for detected in operations):
                frame = T[:3, :3] @ expected.turns[which].T
            located = LocatedModel(T, _express_at_symmetric_pose(located, T), located.explained)
            step = T @ pose.inverse(estimated_poses[operation.main])
            estimated_poses |= {part: step @ estimated_poses[part] for part in operation.moves}
        k = k + 1 if which is None else which + 1
        operations.append(DetectedOperation(first, last, compared, moved, shares, located, group, which))
        first = last
    return tuple(operations)


def _find_end_of_operation(
    images: Sequence[Array],
    first: int,
    noise_m: float,
    assembly: Assembly,
    k: int,
    owners: Sequence[NDArray[np.int64]],
) -> tuple[int, int | None, tuple[Regions, ...], frozenset[str]] | None:
    """Find the image at which the next operation ended.

    Operation k is expected; a later one is accepted if its parts moved. Of consecutive operations that move the same
    parts the last is returned.

    Args:
        first: Index of the image before the operation.
        owners: Per view, which part each looked-up pixel should show, see `_render_part_indices`.

    Returns:
        Index of the image, operation (None if no expected one moves these parts), changed regions per view, and moved
        parts; None if nothing moved.
    """
    spell = None
    for last in range(first + 1, len(images)):
        compared = tuple(find_changed_regions(a, b, noise_m) for a, b in zip(images[first], images[last], strict=True))
        moved = _find_vanished_parts(owners, tuple(assembly.solids), compared) - assembly.fixed
        if not moved:
            continue
        which = next((j for j in range(k, len(assembly)) if moved == set(assembly.operations[j].moves)), None)
        while which is not None and which + 1 < len(assembly) and moved == set(assembly.operations[which + 1].moves):
            which += 1
        if spell is None or (spell[1] is None and moved >= spell[3]) or which == spell[1]:
            spell = last, which, compared, moved
        elif spell[1] is not None and not moved <= spell[3]:
            break
    return spell


def _find_vanished_parts(
    owners: Sequence[NDArray[np.int64]], parts: tuple[str, ...], compared: Sequence[Regions]
) -> frozenset[str]:
    """The parts most of whose visible pixels have vanished.

    Args:
        owners: Per view, index of the part that each looked-up pixel should show, -1 for none.
        parts: Names, in the order of the indices.
        compared: Changed regions per view.
    """
    owner = np.array(owners)
    vanished = np.array([region.vanished[::_GRID_PX, ::_GRID_PX] for region in compared])
    seen = np.bincount(owner[owner >= 0], minlength=len(parts))
    moved_parts = np.bincount(owner[(owner >= 0) & vanished], minlength=len(parts))
    return frozenset(
        part for part, n, m in zip(parts, seen, moved_parts, strict=True) if n and m >= _VANISHED_SHARE * n
    )


def _render_part_indices(view: PinholeView, estimated_poses: Poses, cast: RayCaster) -> NDArray[np.int64]:
    """The index of the part that every third pixel of every third row should show, -1 for none."""
    pixels = np.arange(view.height * view.width).reshape(view.height, view.width)[::_GRID_PX, ::_GRID_PX]
    _, owner = cast(estimated_poses, view.origin, view.rays[pixels.ravel()])
    return owner.reshape(pixels.shape)


def _find_moved_model(
    expected: SensorPriors,
    surfaces: Mapping[str, Surface],
    group: Model | None,
    which: int | None,
    appearance: Appearance,
) -> tuple[Mapping[str, float], LocatedModel | None]:
    """Fit the moved parts and, for comparison, each other part of a different shape.

    Args:
        group: The model of the moved parts; None if the operation is unknown.
        which: The operation, counted from 0, or None.

    Returns:
        Name of a model -> fraction of the change that it explains; and the located model, None if it was not
        recognised or another model explains clearly more.
    """
    assembly = expected.assembly
    points = appearance.points()
    shares: dict[str, float] = {}
    located = None
    if which is not None and group is not None:
        located = locate_model(group, appearance, points)
        shares["+".join(assembly.operations[which].moves)] = located.explained if located else 0.0
    models: dict[str, Model] = {}
    known = [] if group is None else [group.surface]
    for part, surface in surfaces.items():
        if not any(surface.looks_like(other) for other in known):
            models[part] = _model_of_part(assembly, surfaces, part)
            known.append(surface)
    shares |= compare_models(models, appearance, points)
    if located is not None and located.explained < max(shares.values()) - EQUAL_SHARES:
        located = None
    return shares, located


def _model_of_part(assembly: Assembly, surfaces: Mapping[str, Surface], part: str) -> Model:
    """The model of a single part."""
    return Model({part: np.eye(4)}, surfaces[part], find_symmetries(assembly.solids[part]))


def _model_of_moved_parts(
    assembly: Assembly, surfaces: Mapping[str, Surface], estimated_poses: Poses, which: int
) -> Model:
    """The model of all parts that an operation moves, as one rigid body at their estimated relative poses."""
    operation = assembly.operations[which]
    if not operation.carries:
        return _model_of_part(assembly, surfaces, operation.main)
    back = pose.inverse(estimated_poses[operation.main])
    parts = {part: back @ estimated_poses[part] for part in operation.moves}
    posed = {part: (surfaces[part], T) for part, T in parts.items()}
    carried = join_surfaces(posed[part] for part in operation.carries)
    return Model(parts, join_surfaces(posed.values()), np.eye(4)[None], surfaces[operation.main], carried)


def _express_at_symmetric_pose(located: LocatedModel, T: Array) -> Array:
    """The covariance (6, 6) for the symmetric pose T instead of `located.T`: body twists become S^-1 xi S."""
    A = pose.adjoint(pose.inverse(T) @ located.T)
    return np.asarray(A @ located.covariance @ A.T)
