"""Follow a demonstration from range image to range image: what moved, which part it was, where it went.

So the range finder is a sensor of poses: from true range images of a demonstration to an observation of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, Poses
from apo_bench.depth_camera.distance import Shape, alike, join_shapes, shape_of, strike_distances
from apo_bench.depth_camera.locate import ALIKE, Appearance, LocatedModel, Model, locate, model_shares
from apo_bench.depth_camera.range_finder import PinholeView, RangeFinder, RangeImage, Regions, regions
from apo_bench.geometry import Array, frozen, nearest_symmetric_pose, physical_pieces, pose, symmetries, turned_alike
from apo_bench.observation.models import floored

_GONE = 0.5
"""A part has moved if so much of what was seen of it has vanished."""
_GRID = 3
"""Every so many pixels are asked what is seen there."""


@final
@dataclass(frozen=True, eq=False)
class Event:
    """One operation as the range finder saw it."""

    first: int
    """Number of the image before it."""
    last: int
    """Number of the image after it."""
    regions: tuple[Regions, ...]
    """Per view."""
    moved: frozenset[str]
    """The parts that are gone from where they were."""
    explained: Mapping[str, float]
    """How much of what appeared each model explains."""
    found: LocatedModel | None
    """Where the main part is now; None if nothing was recognised."""
    shape: Shape | None
    """What was fitted, in the frame of its main part; None if it is not known what moved."""
    operation: int | None
    """Which operation this was, counted from 0; None if none that was expected."""


@final
@dataclass(frozen=True, eq=False)
class Expected:
    """What is known before looking: topology, models, where parts start, and roughly how they will be turned."""

    assembly: Assembly
    start: Poses
    turns: Array
    """(n, 3, 3), the planned rotation of each goal, world; how the whole is turned is learnt from the first part."""
    play_m: float = 0.0
    """Clearance per side: the models are the parts as they are made."""


def follow_demonstration(
    images: Sequence[Array], finder: RangeFinder, level_m: float, expected: Expected
) -> tuple[Event, ...]:
    """Find every operation in range images, one per quiet spell, each (views, height, width), [m]; the first is before.

    An operation is over in the last spell before something else moves than it does, so that a hand may pause. Only
    what was manipulated is looked for: whatever else moved by less than a pixel or two is not noticed, and stays for
    this sensor where it was. Of operations in a row that move the same parts only where the last one ended is known: a
    pause of the hand looks the same as the end of an operation, so the others are not seen.
    """
    assembly = expected.assembly
    believed = dict(expected.start)
    shapes = {p: shape_of(physical_pieces(s, expected.play_m)) for p, s in assembly.solids.items()}
    events: list[Event] = []
    frame = np.eye(3)
    k = 0
    first = 0
    while first + 1 < len(images) and k < len(assembly):
        owners = [_owners(view, shapes, believed) for view in finder.views]
        spell = _spell(images, first, level_m, assembly, k, owners, tuple(shapes))
        if spell is None:
            break
        last, which, compared, moved = spell
        appearance = Appearance(
            finder.views, images[last], [r.appeared for r in compared], level_m, finder.bias * level_m
        )
        group = None if which is None else _moved(assembly, shapes, believed, which)
        shares, located = _recognised(expected, shapes, group, which, appearance)
        if which is not None and located is not None:
            operation = assembly.operations[which]
            solid = assembly.solids[operation.main]
            turn = frame @ expected.turns[which]
            T = turned_alike(solid, nearest_symmetric_pose(located.T, symmetries(solid), turn), turn)
            if not any(event.found for event in events):
                frame = T[:3, :3] @ expected.turns[which].T
            located = LocatedModel(T, _turned(located, T), located.explained)
            step = T @ pose.inverse(believed[operation.main])
            believed |= {part: step @ believed[part] for part in operation.moves}
        k = k + 1 if which is None else which + 1
        events.append(Event(first, last, compared, moved, shares, located, group and group.shape, which))
        first = last
    return tuple(events)


def _spell(
    images: Sequence[Array],
    first: int,
    noise_m: float,
    assembly: Assembly,
    k: int,
    owners: Sequence[NDArray[np.int64]],
    parts: tuple[str, ...],
) -> tuple[int, int | None, tuple[Regions, ...], frozenset[str]] | None:
    """The spell in which the next operation was over: image, operation, what changed, what moved; None if none was.

    Operation k is looked for first; one that moves something else may come instead, if k was not seen. Of operations in
    a row that move the same parts it is the last, since the spell ends when something else moves.
    """
    spell = None
    for last in range(first + 1, len(images)):
        compared = tuple(regions(a, b, noise_m) for a, b in zip(images[first], images[last], strict=True))
        moved = _gone(owners, parts, compared) - assembly.fixed
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


def _gone(owners: Sequence[NDArray[np.int64]], parts: tuple[str, ...], compared: Sequence[Regions]) -> frozenset[str]:
    """The parts of whose visible surface most has vanished."""
    owner = np.array(owners)
    vanished = np.array([region.vanished[::_GRID, ::_GRID] for region in compared])
    seen = np.bincount(owner[owner >= 0], minlength=len(parts))
    gone = np.bincount(owner[(owner >= 0) & vanished], minlength=len(parts))
    return frozenset(part for part, n, m in zip(parts, seen, gone, strict=True) if n and m >= _GONE * n)


def _owners(view: PinholeView, shapes: Mapping[str, Shape], believed: Poses) -> NDArray[np.int64]:
    """Which part every few pixels of a view should show, by number, -1 for none."""
    owner = np.concatenate([np.full(len(shape.center), i) for i, shape in enumerate(shapes.values())])
    scene = join_shapes(_posed(shape, believed[part]) for part, shape in shapes.items())
    pixels = np.arange(view.height * view.width).reshape(view.height, view.width)[::_GRID, ::_GRID]
    _, box = strike_distances(scene, view.origin, view.rays[pixels.ravel()])
    return np.where(box < 0, -1, owner[box]).reshape(pixels.shape)


def _posed(shape: Shape, T: Array) -> Shape:
    return Shape(shape.center @ T[:3, :3].T + T[:3, 3], shape.half, T[:3, :3] @ shape.turn, shape.inside)


def _recognised(
    expected: Expected, shapes: Mapping[str, Shape], group: Model | None, which: int | None, appearance: Appearance
) -> tuple[Mapping[str, float], LocatedModel | None]:
    """How much each model explains, and where the one that moved is, if none explains more."""
    assembly = expected.assembly
    points = appearance.points()
    shares: dict[str, float] = {}
    located = None
    if which is not None and group is not None:
        located = locate(group, appearance, points)
        shares["+".join(assembly.operations[which].moves)] = located.explained if located else 0.0
    models: dict[str, Model] = {}
    known = [] if group is None else [group.shape]
    for part, solid in assembly.solids.items():
        if part not in assembly.fixed and not any(_alike(shapes[part], shape) for shape in known):
            models[part] = Model(shapes[part], symmetries(solid))
            known.append(shapes[part])
    shares |= model_shares(models, appearance, points)
    if located is not None and located.explained < max(shares.values()) - ALIKE:
        located = None
    return shares, located


def _moved(assembly: Assembly, shapes: Mapping[str, Shape], believed: Poses, which: int) -> Model:
    """What an operation moves, as one rigid thing."""
    operation = assembly.operations[which]
    alone = shapes[operation.main]
    if not operation.carries:
        return Model(alone, symmetries(assembly.solids[operation.main]))
    back = pose.inverse(believed[operation.main])
    together = join_shapes(_posed(shapes[part], back @ believed[part]) for part in operation.moves)
    return Model(together, np.eye(4)[None], main=len(alone.center))


def _alike(a: Shape, b: Shape) -> bool:
    same = all(x.shape == y.shape and np.allclose(x, y) for x, y in zip(a[:3], b[:3], strict=True))
    return same and len(a.inside) == len(b.inside) and all(map(alike, a.inside, b.inside))


def _turned(located: LocatedModel, T: Array) -> Array:
    """The covariance of a pose that looks the same: body twists turn along, S^-1 xi S."""
    A = pose.adjoint(pose.inverse(T) @ located.T)
    return np.asarray(A @ located.covariance @ A.T)


_UNSEEN = frozen(np.diag(np.repeat([0.1, 1.0], 3) ** 2), 6, 6)
"""The covariance that stands beside an operation that was not seen, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class RangeSensor:
    """Called like a noise model, it measures poses instead of drawing them: `(assembly, shown, rng) -> Observation`.

    Of what was shown only the topology, where parts started and how careless people are is looked at; goals are
    fitted to range images. Where a part looks the same when turned, the turn nearest to the planned one is reported,
    and nothing else is taken from the plan.
    """

    finder: RangeFinder
    images: tuple[RangeImage, ...]
    """Without error: before the demonstration and in every quiet spell."""
    level_m: float
    """Standard deviation of a ray."""
    turns: Array
    """(n, 3, 3), the planned rotation of each goal, world."""
    play_m: float
    """Clearance per side, as the models are those of the parts as they are made."""

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        events = self.events(demonstration, self.sensed(rng))
        goals = np.array([demonstration.start[operation.main] for operation in assembly.operations])
        covariance = np.repeat(_UNSEEN[None], len(assembly), axis=0)
        seen = np.zeros(len(assembly), dtype=np.bool_)
        for event in events:
            k = event.operation
            if event.found is not None and k is not None:
                goals[k] = event.found.T
                covariance[k] = event.found.covariance
                seen[k] = True
        return Observation(assembly, demonstration.start, goals, floored(covariance + demonstration.careless), seen)

    def sensed(self, rng: np.random.Generator) -> list[Array]:
        """The images with the errors of the sensor, (views, height, width) each, [m]."""
        return [self.finder.sense(image, self.level_m, rng) for image in self.images]

    def events(self, demonstration: Demonstration, images: Sequence[Array]) -> tuple[Event, ...]:
        """What the sensor makes of measured images, operation by operation."""
        expected = Expected(demonstration.assembly, demonstration.start, self.turns, self.play_m)
        return follow_demonstration(images, self.finder, self.level_m, expected)
