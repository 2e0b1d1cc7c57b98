"""Noise models, one a file."""

from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import floor_covariance, with_shared
from apo_bench.perception.observation.models.empirical import Empirical, empirical_noise
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel
from apo_bench.perception.observation.models.failures import CameraFailures
from apo_bench.perception.observation.models.fitted import (
    LEAST_FREEDOM,
    SMALLEST_SCALE,
    Fitted,
    MeasuredNoise,
)
from apo_bench.perception.observation.models.isotropic import HeavyTailed, Isotropic, PerPart
from apo_bench.perception.observation.models.outliers import UNSEEN_DEVIATION, Outliers, last_seen
from apo_bench.perception.observation.models.residuals import INLIER_MM, TURNED_DEG, Residuals
from apo_bench.perception.observation.models.shared import Bias
from apo_bench.perception.observation.models.sighted import Anisotropic, Sighted
from apo_bench.perception.observation.models.symmetric import AnyTurn, Symmetric
from apo_bench.perception.observation.models.tails import Split, Tail, log_density_across, log_density_along, of_numbers

__all__ = (
    "INLIER_MM",
    "LEAST_FREEDOM",
    "SMALLEST_SCALE",
    "TURNED_DEG",
    "UNSEEN_DEVIATION",
    "Anisotropic",
    "AnyTurn",
    "Bias",
    "Camera",
    "CameraFailures",
    "Empirical",
    "Facts",
    "Fitted",
    "HeavyTailed",
    "Isotropic",
    "MeasuredNoise",
    "NoiseLevel",
    "Outliers",
    "PerPart",
    "Residuals",
    "Sighted",
    "Split",
    "Symmetric",
    "Tail",
    "empirical_noise",
    "floor_covariance",
    "last_seen",
    "log_density_across",
    "log_density_along",
    "of_numbers",
    "with_shared",
)
