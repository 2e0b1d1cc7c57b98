"""Locate a model in the region that appeared: fit from many start poses, and keep the pose that explains most."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from apo_bench.geometry import Array, copy_frozen
from apo_bench.perception.depth_camera.change_detection import Mask, filter_median
from apo_bench.perception.depth_camera.explained_share import measure_explained_share
from apo_bench.perception.depth_camera.icp import Points, RefinedPoses, compute_fit_covariance, refine_fit
from apo_bench.perception.depth_camera.icp_starts import guess_poses
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.perception.depth_camera.ray_caster import RayCaster
from apo_bench.perception.depth_camera.surface import Surface

_COARSE = 150
"""Points of the first fit, from every start pose."""
_MIDDLE = 500
"""Points of the second fit, from the best results."""
_FINE = 3000
"""Points of the last fit."""
_BEST = 4
"""Results of the first fit that are refined; more than one, since some fits end in a wrong minimum."""
_WIDTH_M = 0.0015
"""Width of the last fit, unless three standard deviations of a ray are more; see `refine_fit`."""
_WELL_SEEN = copy_frozen([0.001] * 3 + [np.radians(1.0)] * 3, 6)
"""If the standard deviations of the main part alone are smaller, the parts that it carries are ignored, [m, rad]."""
_WIDE_M = 0.012
"""Width of the first fit; wide, so that points at the ends of a part count."""
_LEAST_EXPLAINED = 0.6
"""A model that explains less was not recognised."""
EQUAL_SHARES = 0.03
"""A model that explains less than the best one by no more than this may still be the right one."""


@final
@dataclass(frozen=True, eq=False)
class Model:
    """A rigid model that the range finder searches for: one part, or a main part with the parts that it carries."""

    parts: Mapping[str, Array]
    """Main and carried parts -> pose (4, 4) in the frame of the main part."""
    surface: Surface
    """Of all parts, in the frame of the main part."""
    same: Array
    """(m, 4, 4), symmetries: displacements that leave its shape unchanged; the identity first."""
    main: Surface | None = None
    """Surface of the main part alone, if it carries others."""
    carried: Surface | None = None
    """Surface of the carried parts, if there are any."""

    def place_parts(self, T: Array) -> Mapping[str, Array]:
        """The poses of the parts, world, if the main part is at T, (4, 4)."""
        return {part: T @ offset for part, offset in self.parts.items()}


@final
@dataclass(frozen=True, eq=False)
class Appearance:
    """The surfaces that appeared between two range images."""

    views: Sequence[PinholeView]
    images: Array
    """(views, height, width), the later images, [m]."""
    masks: Sequence[Mask]
    """Per view, pixels that are nearer than before."""
    noise_m: float
    """Standard deviation of the independent error of a ray."""
    bias_m: float
    """Standard deviation of the error that all rays of one view have in common."""
    cast: RayCaster
    """Casts rays at the models of the parts."""

    def points(self) -> Points:
        """The measured points in the masks, without the outermost pixels of each region."""
        from scipy.ndimage import binary_erosion

        points: list[Points] = []
        for v, (view, image, mask) in enumerate(zip(self.views, self.images, self.masks, strict=True)):
            pixels = np.flatnonzero(binary_erosion(mask) & np.isfinite(image))
            ray = view.rays[pixels]
            points.append(Points(view.origin + image.ravel()[pixels, None] * ray, ray, np.full(len(pixels), v)))
        return Points(*(np.concatenate([getattr(each, name) for each in points]) for name in ("at", "ray", "view")))

    @cached_property
    def smooth(self) -> Array:
        """The images after an edge-preserving median filter; NaN around missing readings."""
        return np.array([filter_median(image) for image in self.images])

    @property
    def width_m(self) -> float:
        """Width of the last fit, [m]."""
        return max(_WIDTH_M, 3.0 * self.noise_m)


@final
@dataclass(frozen=True, eq=False)
class LocatedModel:
    """The fitted pose of a model."""

    T: Array
    """(4, 4), pose of the main part, world, [m]; of a symmetric part any one of the equivalent poses."""
    covariance: Array
    """(6, 6), covariance of the body twist of its error, [m, rad]."""
    explained: float
    """Fraction of the change that it explains, 0 to 1."""


def locate_model(model: Model, appearance: Appearance, points: Points) -> LocatedModel | None:
    """Fit a model to the points that appeared; None if they are too few, or if the model does not explain them.

    A main part is first located together with the parts that it carries, as one rigid body. Carried parts may have
    shifted in the hand, so the last fit uses the main part alone, if enough of it is visible.
    """
    if len(points) < 6:  # a pose has six unknowns
        return None
    best, _ = _choose_best(model, appearance, points)
    T, C = _fit_finely(model.surface, appearance, points.thin_out(_FINE), best)
    share = _explained_share(model, appearance, T)
    if share < _LEAST_EXPLAINED:
        return None
    if model.main is not None and model.carried is not None:
        local = (points.at - T[:3, 3]) @ T[:3, :3]
        _, far = model.main.find_nearest(local)
        _, others = model.carried.find_nearest(local)
        # Points of the main part: near to it, and nearer to it than to the carried parts.
        own = points.select((far < 2.0 * appearance.width_m) & (far < others))
        if len(own) >= 6:
            alone = _fit_finely(model.main, appearance, own.thin_out(_FINE), T)
            if (np.sqrt(np.diag(alone[1])) < _WELL_SEEN).all():
                T, C = alone
    return LocatedModel(T, C, share)


def compare_models(models: Mapping[str, Model], appearance: Appearance, points: Points) -> Mapping[str, float]:
    """Name of a model -> fraction of the change, 0 to 1, that it explains at its best pose."""
    if len(points) < 6:
        return dict.fromkeys(models, 0.0)
    return {name: _choose_best(model, appearance, points)[1] for name, model in models.items()}


def _fit_finely(surface: Surface, appearance: Appearance, points: Points, T: Array) -> tuple[Array, Array]:
    """The last fit, from a good start pose T: the pose (4, 4) and its covariance (6, 6)."""
    T = refine_fit(surface, points, T[None], appearance.width_m, 20).T[0]
    return T, compute_fit_covariance(surface, points, T, appearance.width_m, appearance.noise_m, appearance.bias_m)


def _fit_from_all_starts(model: Model, appearance: Appearance, points: Points) -> RefinedPoses:
    """Fit from all start poses with few points, then refine the best `_BEST` with narrower widths."""
    surface = model.surface
    wide = max(_WIDE_M, 3.0 * appearance.width_m)
    first = refine_fit(surface, points.thin_out(_COARSE), guess_poses(surface.corners, points.at, model.same), wide, 10)
    best = first.T[np.argsort(first.cost, kind="stable")[:_BEST]]
    middle = points.thin_out(_MIDDLE)
    nearer = refine_fit(surface, middle, best, np.sqrt(appearance.width_m * wide), 8)
    return refine_fit(surface, middle, nearer.T, appearance.width_m, 8)


def _choose_best(model: Model, appearance: Appearance, points: Points) -> tuple[Array, float]:
    """The best pose (4, 4), by explained fraction less cost of the fit, and its explained fraction."""
    fits = _fit_from_all_starts(model, appearance, points)
    shares = np.array([_explained_share(model, appearance, T) for T in fits.T])
    best = int(np.argmax(shares - fits.cost))
    return fits.T[best], float(shares[best])


def _explained_share(model: Model, appearance: Appearance, T: Array) -> float:
    """The fraction of the change that the model explains at pose T."""
    seen = appearance
    return measure_explained_share(model.place_parts(T), seen.cast, seen.views, seen.smooth, seen.masks, seen.noise_m)
