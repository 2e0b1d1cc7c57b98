"""An observation as a camera of known noise would have stated it."""

from dataclasses import replace

import numpy as np

from apo_bench.assembly.goals import Observation
from apo_bench.geometry import pose
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.fitted import LEVEL_UNITS, Fitted, MeasuredNoise, stated_tails, view_error
from apo_bench.observation.models.isotropic import floored, with_shared
from apo_bench.observation.models.level import Level

_AS_MEASURED = Level(1.0, 1.0)


def restated(observation: Observation, measured: MeasuredNoise, camera: Camera) -> Observation:
    """What was seen, a constant error of the camera taken out, with the covariances of measured noise.

    Covariances that it stated itself are not looked at, but for those of operations that were not seen.
    """
    goals = np.array(observation.goals)
    if measured.constant is not None:
        P = measured.constant.frame
        goals = P @ pose.exp(-measured.constant.twist) @ pose.inverse(P) @ goals
    stated = floored(camera.covariance(goals, Fitted(measured, _AS_MEASURED, camera).covariance))
    stated = np.where(observation.seen[:, None, None], stated, observation.covariance)
    tails = stated_tails(measured, _AS_MEASURED, camera, goals)
    made = replace(observation, goals=goals, covariance=stated, shared=(), tails=tails)
    if measured.view is None or not any(measured.view) or not len(goals):
        return made
    return with_shared(made, view_error(camera, goals, np.repeat(measured.view, 3) * LEVEL_UNITS))
