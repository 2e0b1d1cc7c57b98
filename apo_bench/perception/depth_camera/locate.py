"""Locate what appeared: fit every model, and keep the one that explains most."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from apo_bench.geometry import Array, copy_frozen
from apo_bench.perception.depth_camera.explained import measure_share
from apo_bench.perception.depth_camera.fit import Fits, Points, covariance, refine_fit
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.perception.depth_camera.rays import RayCaster
from apo_bench.perception.depth_camera.regions import Mask, filter_median
from apo_bench.perception.depth_camera.starts import guess_poses
from apo_bench.perception.depth_camera.surface import Surface

_COARSE = 150
_MIDDLE = 500
_FINE = 3000
"""Points of a first fit from every start, of the best of these, and of the last fit."""
_BEST = 4
"""Starts that are followed further: one fit in some ends off the true place, so never only one."""
_WIDTH_M = 0.0015
"""Points this far away from a surface are half doubted; three standard deviations if that is more."""
_WELL_SEEN = copy_frozen([0.001] * 3 + [np.radians(1.0)] * 3, 6)
"""A main part that is known this well by its own points needs no help of what it carries, [m, rad]."""
_WIDE_M = 0.012
"""The width at which a fit begins; it is narrowed from there, so that no end of a part is left behind."""
_LEAST_EXPLAINED = 0.6
"""A model that explains less was not recognised."""
ALIKE = 0.03
"""What explains less than the best by no more than this may be the right one."""


@final
@dataclass(frozen=True, eq=False)
class Model:
    """A part, or several that move as one, as the range finder looks for them."""

    parts: Mapping[str, Array]
    """The main part and others, with their poses (4, 4) in its frame."""
    surface: Surface
    """In the frame of its main part."""
    same: Array
    """(m, 4, 4), displacements after which it looks the same; the identity first."""
    main: Surface | None = None
    """That of the main part alone, if it carries others."""
    carried: Surface | None = None
    """That of the others."""

    def put(self, T: Array) -> Mapping[str, Array]:
        """Where the parts are, if the model is at T, (4, 4), world."""
        return {part: T @ offset for part, offset in self.parts.items()}


@final
@dataclass(frozen=True, eq=False)
class Appearance:
    """What appeared between two firings."""

    views: Sequence[PinholeView]
    images: Array
    """(views, height, width), the later images, [m]."""
    masks: Sequence[Mask]
    """Per view, where something is nearer than before."""
    noise_m: float
    bias_m: float
    cast: RayCaster

    def points(self) -> Points:
        """The measured points; the outermost pixels of the regions are left out."""
        from scipy.ndimage import binary_erosion

        points: list[Points] = []
        for v, (view, image, mask) in enumerate(zip(self.views, self.images, self.masks, strict=True)):
            pixels = np.flatnonzero(binary_erosion(mask) & np.isfinite(image))
            ray = view.rays[pixels]
            points.append(Points(view.origin + image.ravel()[pixels, None] * ray, ray, np.full(len(pixels), v)))
        return Points(*(np.concatenate([getattr(each, name) for each in points]) for name in ("at", "ray", "view")))

    @cached_property
    def smooth(self) -> Array:
        """The images with less noise, edges kept; NaN around what is missing."""
        return np.array([filter_median(image) for image in self.images])

    @property
    def width_m(self) -> float:
        return max(_WIDTH_M, 3.0 * self.noise_m)


@final
@dataclass(frozen=True, eq=False)
class LocatedModel:
    """A model where it was found."""

    T: Array
    """(4, 4), of the frame of the model, world, [m]; one of those that look the same."""
    covariance: Array
    """(6, 6), of the body twist by which it is wrong, [m, rad]."""
    explained: float
    """0 to 1."""


def locate(model: Model, appearance: Appearance, points: Points) -> LocatedModel | None:
    """Fit a model to what appeared; None if there are too few points, or they are not explained by it.

    A main part with what it carries is found as one rigid thing. As a carried part may have been shifted in the hand,
    the last fit is that of the main part alone, if enough of it is visible.
    """
    if len(points) < 6:
        return None
    best, _ = _best(model, appearance, points)
    T, C = _fine(model.surface, appearance, points.thinned(_FINE), best)
    share = _share(model, appearance, T)
    if share < _LEAST_EXPLAINED:
        return None
    if model.main is not None and model.carried is not None:
        local = (points.at - T[:3, 3]) @ T[:3, :3]
        _, far = model.main.find_nearest(local)
        _, others = model.carried.find_nearest(local)
        own = points.only((far < 2.0 * appearance.width_m) & (far < others))
        if len(own) >= 6:
            alone = _fine(model.main, appearance, own.thinned(_FINE), T)
            if (np.sqrt(np.diag(alone[1])) < _WELL_SEEN).all():
                T, C = alone
    return LocatedModel(T, C, share)


def compare_models(models: Mapping[str, Model], appearance: Appearance, points: Points) -> Mapping[str, float]:
    """How much of what appeared each model explains where it fits best, 0 to 1."""
    if len(points) < 6:
        return dict.fromkeys(models, 0.0)
    return {name: _best(model, appearance, points)[1] for name, model in models.items()}


def _fine(surface: Surface, appearance: Appearance, points: Points, T: Array) -> tuple[Array, Array]:
    """The last fit, from a good start, and its covariance."""
    T = refine_fit(surface, points, T[None], appearance.width_m, 20).T[0]
    return T, covariance(surface, points, T, appearance.width_m, appearance.noise_m, appearance.bias_m)


def _coarse(model: Model, appearance: Appearance, points: Points) -> Fits:
    """The best few of the fits from all starts."""
    surface = model.surface
    wide = max(_WIDE_M, 3.0 * appearance.width_m)
    first = refine_fit(surface, points.thinned(_COARSE), guess_poses(surface.corners, points.at, model.same), wide, 10)
    best = first.T[np.argsort(first.cost, kind="stable")[:_BEST]]
    middle = points.thinned(_MIDDLE)
    nearer = refine_fit(surface, middle, best, np.sqrt(appearance.width_m * wide), 8)
    return refine_fit(surface, middle, nearer.T, appearance.width_m, 8)


def _best(model: Model, appearance: Appearance, points: Points) -> tuple[Array, float]:
    """The pose (4, 4) that explains most, and how much, judged together with how close it is."""
    fits = _coarse(model, appearance, points)
    shares = np.array([_share(model, appearance, T) for T in fits.T])
    best = int(np.argmax(shares - fits.cost))
    return fits.T[best], float(shares[best])


def _share(model: Model, appearance: Appearance, T: Array) -> float:
    seen = appearance
    return measure_share(model.put(T), seen.cast, seen.views, seen.smooth, seen.masks, seen.noise_m)
