"""Noise that resamples the measured residuals of a pose estimator."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, make_measured_model
from apo_bench.errors import require
from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.io import CsvRow, read_csv
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel
from apo_bench.perception.observation.models.fitted import LEVEL_UNITS, check_measured_level, observe_in_ray_frames
from apo_bench.perception.observation.models.residuals import Residuals

_INLIER = "inlier"
_TURNED = "turned"
_OUTLIER = "outlier"
_MISSED = "missed"
_KINDS = (_INLIER, _TURNED, _OUTLIER, _MISSED)
_ERRORS = ("x_mm", "y_mm", "along_mm", "turn_x_deg", "turn_y_deg", "turn_along_deg")
_COLUMNS = ("scene_id", "im_id", "obj_id", "kind", *_ERRORS)
MOST_RESIDUALS = 8000
"""Rows of a file of residuals, at most; of more residuals every k-th is written."""
_LARGEST_MM = 1e5
"""Largest allowed position error in a file."""
_LARGEST_DEG = 180.01
"""Largest allowed rotation in a file, with a margin for rounding."""


@final
@dataclass(frozen=True, eq=False)
class ResidualSample:
    """Residuals to draw from, as errors in the frames of rays, [m, rad]; a shift acts in the observed frame."""

    inliers: Array
    """(k, 6), residuals of inliers whose rotation is known."""
    outliers: Array
    """(m, 6), residuals of outliers."""
    missed: float
    """Fraction of all parts without an estimate."""
    gross: float
    """Fraction of outliers among the estimates."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "inliers", copy_frozen(self.inliers, None, 6))
        object.__setattr__(self, "outliers", copy_frozen(self.outliers, None, 6))

    @property
    def covariance(self) -> Array:
        """(6, 6), covariance of an inlier with random sign, which is the mean square."""
        return self.inliers.T @ self.inliers / len(self.inliers)


@final
@dataclass(frozen=True, eq=False)
class EmpiricalNoise:
    """Noise that draws each error from measured residuals of a pose estimator, all six components together.

    The sign is random, so that the mean is 0: a bias of the estimator becomes part of the spread. Misses and outliers
    are as frequent as measured. Residuals of inliers with an ambiguous rotation (symmetric parts) are left out.
    """

    sample: ResidualSample
    noise_level: NoiseLevel
    camera: Camera = field(default_factory=Camera)

    FACTS: ClassVar[Facts] = Facts(
        title="the residuals of a pose estimator themselves, drawn at random",
        formula=("T_obs = T exp(xi), xi = (R_obs^t F d, R^t F w), (d, w) = L times a residual, or minus that",),
        frame="F of the ray from the camera to the origin of the part, as of the model `camera`",
        parameters=("all in the file: residuals, which of them are outliers, and the share of missed parts",),
        states="the mean square of the residuals of inliers, in the frame of the observed part",
        notes=("Level 1 is as measured", "At level 0 nothing is missed"),
        measured=True,
    )

    def __post_init__(self) -> None:
        check_measured_level(self.noise_level, self.sample.covariance)

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        n = len(assembly)
        sample = self.sample
        # Columns of chance: choice of the residual, outlier or not, missed or not; always drawn for all operations.
        chance = rng.random((n, 3))
        sign = rng.choice([-1.0, 1.0], (n, 1))
        errors = _select_rows(sample.inliers, chance[:, 0])
        if len(sample.outliers):
            errors = np.where(chance[:, 1:2] < sample.gross, _select_rows(sample.outliers, chance[:, 0]), errors)
        missed = chance[:, 2] < sample.missed
        seen = observe_in_ray_frames(
            self.camera, self.noise_level, demonstration, assembly, sign * errors, sample.covariance, missed
        )
        return replace(seen, outliers=make_measured_model(sample.gross))


def load_empirical_noise(path: Path, noise_level: NoiseLevel) -> EmpiricalNoise:
    """Make the noise model of a file of residuals; an unchanged file is read only once.

    Raises:
        InputError: The file is not valid; the message names the line.
    """
    return EmpiricalNoise(_read_cached(path, path.stat().st_mtime_ns if path.exists() else 0), noise_level)


def format_residuals(residuals: Residuals) -> str:
    """The text of a file of residuals: one row per part in the truth, [mm, degrees], in the frame of its ray."""
    every = -(-len(residuals.where) // MOST_RESIDUALS)  # rounded up
    lines = [",".join(_COLUMNS)]
    kinds = np.select(
        [~residuals.is_estimated, ~residuals.is_inlier, ~residuals.has_rotation_error],
        [_MISSED, _OUTLIER, _TURNED],
        default=_INLIER,
    )
    for k in range(0, len(residuals.where), every):
        numbers = np.concatenate([residuals.shift_mm[k], residuals.turn_deg[k]])
        cells = [f"{x:.3f}" for x in numbers] if residuals.is_estimated[k] else [""] * 6
        lines.append(",".join([*map(str, residuals.where[k].tolist()), kinds[k], *cells]))
    return "\n".join(lines) + "\n"


def read_residuals(path: str | Path) -> ResidualSample:
    """Read a file of residuals; see `load_empirical_noise`."""
    columns = {name: (name, 1.0) for name in _COLUMNS}
    errors: dict[str, list[list[float]]] = {kind: [] for kind in _KINDS}
    for row in read_csv(path, columns, _COLUMNS):
        kind = row.text("kind")
        row.require(kind in _KINDS, "kind", f"{', '.join(_KINDS[:-1])} or {_KINDS[-1]} is needed")
        errors[kind].append([] if kind == _MISSED else _read_error(row))
    count = {kind: len(estimates) for kind, estimates in errors.items()}
    estimates = sum(count.values()) - count[_MISSED]
    require(
        count[_INLIER], f"{path}: no residual of an inlier stands in the file; write one with noise fit --residuals."
    )
    return ResidualSample(
        inliers=_convert_to_camera_errors(errors[_INLIER]),
        outliers=_convert_to_camera_errors(errors[_OUTLIER]),
        missed=count[_MISSED] / (estimates + count[_MISSED]),
        gross=count[_OUTLIER] / estimates,
    )


@lru_cache(maxsize=8)
def _read_cached(path: Path, _changed: int) -> ResidualSample:
    """Read a file of residuals; `_changed`, its modification time, is only a key of the cache."""
    return read_residuals(path)


def _read_error(row: CsvRow) -> list[float]:
    """The six error columns of a row, [mm, degrees]."""
    return [row.number(name, _LARGEST_MM if name.endswith("_mm") else _LARGEST_DEG) for name in _ERRORS]


def _convert_to_camera_errors(errors: list[list[float]]) -> Array:
    """Convert residuals (n, 6) [mm, deg] to the errors (d, w) [m, rad] that `Camera.twists` takes.

    `Camera.twists` shifts a part that it turns by w by V(-w) d, with V of the exponential exp(d, w) = (exp w, V(w) d).
    So d is the measured shift times the inverse of V(-w), which reproduces the estimated pose exactly.
    """
    # log of the pose with rotation exp(-w) and position d is (V(-w)^-1 d, -w).
    measured = np.array(errors).reshape(-1, 6) * LEVEL_UNITS
    back = np.concatenate([np.zeros((len(measured), 3)), -measured[:, 3:]], axis=1)
    T = pose.exp(back)
    T[:, :3, 3] = measured[:, :3]
    return np.concatenate([pose.log(T)[:, :3], measured[:, 3:]], axis=1)


def _select_rows(rows: Array, chance: Array) -> Array:
    """Select one row (with repetition) for each uniform number of chance, (n,), 0 to 1."""
    return rows[np.minimum((chance * len(rows)).astype(np.int64), len(rows) - 1)]
