"""The noise models of the package, with the cameras and distributions that they share."""

from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.camera_failures import CameraFailures
from apo_bench.perception.observation.models.displacement import add_shared_error, floor_covariance
from apo_bench.perception.observation.models.empirical import EmpiricalNoise, load_empirical_noise
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel
from apo_bench.perception.observation.models.fitted import (
    LEAST_FREEDOM,
    SMALLEST_SCALE,
    FittedNoise,
    MeasuredNoise,
)
from apo_bench.perception.observation.models.isotropic import HeavyTailedNoise, IsotropicNoise, PerPartNoise
from apo_bench.perception.observation.models.line_of_sight import AnisotropicNoise, CameraNoise
from apo_bench.perception.observation.models.outliers import (
    UNOBSERVED_DEVIATION,
    OutlierNoise,
    find_last_observed_poses,
)
from apo_bench.perception.observation.models.pose_results import PoseResults, TrialKey, read_pose_results
from apo_bench.perception.observation.models.residuals import INLIER_MM, TURNED_DEG, Residuals
from apo_bench.perception.observation.models.shared_bias import BiasNoise
from apo_bench.perception.observation.models.symmetric_parts import AnyTurnNoise, SymmetricNoise
from apo_bench.perception.observation.models.truncated_tails import (
    StudentT,
    TruncatedTails,
    compute_log_density_across,
    compute_log_density_along,
    unpack_tails,
)

__all__ = (
    "INLIER_MM",
    "LEAST_FREEDOM",
    "SMALLEST_SCALE",
    "TURNED_DEG",
    "UNOBSERVED_DEVIATION",
    "AnisotropicNoise",
    "AnyTurnNoise",
    "BiasNoise",
    "Camera",
    "CameraFailures",
    "CameraNoise",
    "EmpiricalNoise",
    "Facts",
    "FittedNoise",
    "HeavyTailedNoise",
    "IsotropicNoise",
    "MeasuredNoise",
    "NoiseLevel",
    "OutlierNoise",
    "PerPartNoise",
    "PoseResults",
    "Residuals",
    "StudentT",
    "SymmetricNoise",
    "TrialKey",
    "TruncatedTails",
    "add_shared_error",
    "compute_log_density_across",
    "compute_log_density_along",
    "find_last_observed_poses",
    "floor_covariance",
    "load_empirical_noise",
    "read_pose_results",
    "unpack_tails",
)
