"""Visible surface discrepancy (VSD) of pose estimates, with ray casts of the models in place of renderings.

After T. Hodan et al., BOP: Benchmark for 6D object pose estimation, ECCV 2018, with the step cost and the tolerances of
the BOP Challenge 2019.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.simulation.sensor.rays import ModelRays

TOLERANCES = np.arange(1, 11) * 0.05
"""Misalignment tolerances, relative to the diameter of the object."""
_VISIBLE_M = 0.015
"""Distance behind the measured surface up to which a model counts as visible."""


@final
@dataclass(frozen=True, eq=False)
class DepthView:
    """A depth image, and models that can be cast into it."""

    distance: Array
    """(height, width), measured along the rays, [m]; NaN without a reading."""
    view: PinholeView
    cast: ModelRays

    def cast_model(self, number: int, T_camera_part: Array) -> Array:
        """The distances at which an object alone is hit, (height, width), [m], infinite elsewhere.

        Args:
            T_camera_part: (4, 4), [m].
        """
        pixels = self.cast.find_pixels(str(number), self.view.T_world_view @ T_camera_part, self.view)
        return pixels.fill_image(self.view.height, self.view.width)


def compute_vsd(measured: Array, true: Array, estimated: Array, diameter_m: float) -> Array:
    """The discrepancy for each of `TOLERANCES`, (10,), from 0 to 1.

    Args:
        measured: Distances along the rays, (height, width), [m]; NaN without a reading, where models count as visible.
        true, estimated: Distances of the model alone at its true and its estimated pose, infinite elsewhere.
    """
    behind = np.where(np.isnan(measured), np.inf, measured + _VISIBLE_M)
    of_true = np.isfinite(true) & (true <= behind)
    of_estimated = np.isfinite(estimated) & ((estimated <= behind) | of_true)
    both = of_true & of_estimated
    either = np.count_nonzero(of_true | of_estimated)
    if not either:
        return np.ones(len(TOLERANCES))
    far = np.abs(true[both] - estimated[both]) / diameter_m
    wrong = np.count_nonzero(far[:, None] >= TOLERANCES, axis=0)
    return np.asarray((wrong + either - np.count_nonzero(both)) / either)


def compute_discrepancies(image: DepthView, number: int, true: Array, estimated: Array, diameter_m: float) -> Array:
    """The discrepancies of each pair of a true pose and an estimate, (k, j, 10).

    Args:
        number: Of the object.
        true, estimated: Poses of the part, (k, 4, 4) and (j, 4, 4), camera frame, [m].
    """
    alone = [[image.cast_model(number, T) for T in several] for several in (true, estimated)]
    found = [[compute_vsd(image.distance, a, b, diameter_m) for b in alone[1]] for a in alone[0]]
    return np.array(found).reshape(len(true), len(estimated), len(TOLERANCES))
