"""Poses that a pose estimator found in the images of trials, in place of a noise model.

They come from a results file of the BOP format in the folder of a data set that `apo-bench dataset make --format bop`
wrote. Nothing of the true poses is used.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, Poses, make_measured_model
from apo_bench.errors import InputError, require
from apo_bench.formats.bop import PoseRows, read_results
from apo_bench.formats.bop_images import (
    DESCRIPTION,
    ImageDescription,
    PublishedCamera,
    SceneEntry,
    find_images,
    read_cameras,
    read_image_description,
)
from apo_bench.geometry import Array, find_nearest_equivalent_pose, measure_extent, pose
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import floor_covariance
from apo_bench.perception.observation.models.facts import NoiseLevel
from apo_bench.perception.observation.models.fitted import LEVEL_UNITS, MeasuredNoise, restate_covariance
from apo_bench.perception.observation.models.outliers import UNOBSERVED_DEVIATION, find_last_observed_poses

_TIE = 1e-6  # cost of a worse score, relative to the smallest extent of a part


class TrialKey(NamedTuple):
    """What a trial shares with a scene of a data set of images."""

    scenario: str
    seed: int
    clearance_mm: float
    secret_seed: str | None
    """Hash of the secret seed."""


@final
@dataclass(frozen=True, eq=False)
class PoseResults:
    """The results of a pose estimator in a data set of images, before the trial is known."""

    file: str
    folder: Path
    """Folder of the data set."""
    description: ImageDescription
    rows: PoseRows
    noise_level: NoiseLevel
    """Standard deviation of the poses per axis that observations state, [mm, degrees]."""
    fitted: MeasuredNoise | None = None
    """Distribution of the errors in the frames of camera rays, stated in place of the noise level."""

    def of_trial(self, key: TrialKey, turns: Array) -> "TrialResults":
        """The poses of one trial, as a noise model.

        Args:
            turns: (n, 3, 3), the planned rotation of each target pose, world.

        Raises:
            InputError: The data set has no images of this trial.
        """
        drawn = self.description.secret_seed
        for number, scene in self.description.scenes.items():
            if (scene.scenario, scene.seed, scene.clearance_mm, drawn) == key:
                folder = self.folder / self.description.split / f"{int(number):06d}"
                return TrialResults(self, int(number), scene, read_cameras(folder), turns)
        seeds = sorted(scene.seed for scene in self.description.scenes.values() if scene.scenario == key.scenario)
        shown = f"seeds {seeds[0]} to {seeds[-1]}" if seeds else "none"
        raise InputError(
            f"{self.folder / DESCRIPTION}: no scene is of {key.scenario}, seed {key.seed}, clearance "
            f"{key.clearance_mm:g} mm and the same secret seed; of this scenario it has {shown}."
        )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        raise InputError(f"the poses in '{self.file}' are those of trials; observe a trial that has images.")


@final
@dataclass(frozen=True, eq=False)
class TrialResults:
    """The results of a pose estimator in the images of one trial, with the signature of a noise model."""

    results: PoseResults
    number: int
    """Number of the scene."""
    scene: SceneEntry
    cameras: Mapping[int, PublishedCamera]
    """By the number of the image."""
    turns: Array
    """(n, 3, 3), the planned rotation of each target pose, world."""

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        """Choose an estimate for the main part of each operation; an operation without one was not observed.

        Of several cameras the estimate with the best score counts. A symmetric part is folded to the pose that is
        nearest to the planned rotation.
        """
        n = len(assembly)
        poses = np.tile(np.eye(4), (n, 1, 1))
        cameras = np.tile(np.eye(4), (n, 1, 1))
        observed = np.zeros(n, dtype=np.bool_)
        estimated = dict(demonstration.start)
        for k, operation in enumerate(assembly.operations):
            found = self._find_best(assembly, k, estimated)
            if found is None:
                continue
            observed[k] = True
            expected = pose.rigid(self.turns[k], found.T[:3, 3])
            poses[k] = find_nearest_equivalent_pose(assembly.solids[operation.main], found.T, expected)
            cameras[k] = self.cameras[found.image].T_world_camera
            step = poses[k] @ pose.inverse(estimated[operation.main])
            estimated |= {part: step @ estimated[part] for part in operation.moves}
        poses = find_last_observed_poses(assembly, demonstration.start, poses, observed)
        observation = Observation(assembly, demonstration.start, poses, self._state(n), observed)
        if self.results.fitted is not None:
            observation = self._restate(observation, cameras, self.results.fitted)
        stated = floor_covariance(observation.covariance + demonstration.human_error_covariance)
        missed = np.diag(UNOBSERVED_DEVIATION**2)
        outliers = None if self.results.fitted is None else make_measured_model(self.results.fitted.outliers)
        return replace(
            observation, covariance=np.where(observed[:, None, None], stated, missed), tails=None, outliers=outliers
        )

    def _find_best(self, assembly: Assembly, k: int, estimated: Poses) -> "_Estimate | None":
        """The estimate of the main part of operation k with the best score; None if there is none."""
        images = [int(image) for image, entry in self.scene.images.items() if entry.operation == k + 1]
        found = [each for image in images if (each := self._assign(assembly, k, image, estimated)) is not None]
        return max(found, key=lambda each: each.score, default=None)

    def _assign(self, assembly: Assembly, k: int, image: int, estimated: Poses) -> "_Estimate | None":
        """The estimate of the main part of operation k in an image; None if there is none.

        Parts that are alike are told apart by their places: those that the operation does not move are expected where
        they were last, and the main part is the one that is left.

        Args:
            estimated: Part -> its last estimated pose, (4, 4), world.
        """
        from scipy.optimize import linear_sum_assignment

        operation = assembly.operations[k]
        number = self.scene.parts[operation.main]
        alike = [part for part, each in self.scene.parts.items() if each == number and part not in operation.moves]
        candidates = self._list_estimates(image, number)[: len(alike) + 1]
        if not candidates:
            return None
        solid = assembly.solids[operation.main]
        centers = pose.apply_all(np.array([each.T for each in candidates]), solid.centroid[None])
        reach = min(np.ptp(measure_extent(solid.pieces, axis)) for axis in np.eye(3))
        expected = np.array([pose.apply(estimated[part], solid.centroid[None])[0] for part in alike]).reshape(-1, 3)
        distances = np.linalg.norm(expected[:, None] - centers[:, 0], axis=2)
        # The main part may be anywhere, but not where an equal part stays; ties go to the better score.
        nearest = distances.min(axis=0, initial=np.inf)
        of_main = reach + np.clip(reach - nearest, 0.0, reach) + _TIE * reach * np.arange(len(candidates))
        which, chosen = linear_sum_assignment(np.concatenate([np.minimum(distances, 2.0 * reach), of_main[None]]))
        left = chosen[which == len(alike)]
        return candidates[left[0]] if len(left) else None

    def _list_estimates(self, image: int, number: int) -> "list[_Estimate]":
        """The estimates of an object in an image, the best score first."""
        rows = self.results.rows
        found = np.flatnonzero((rows.where == (self.number, image, number)).all(axis=1))
        offset = pose.inverse(self.results.description.offset(number))
        R = pose.nearest_rotations(rows.R[found])
        T = self.cameras[image].T_world_camera @ pose.rigid(R, 1e-3 * rows.t_mm[found]) @ offset
        order = np.argsort(-rows.score[found], kind="stable")
        return [_Estimate(T[i], float(rows.score[found[i]]), image) for i in order]

    def _state(self, n: int) -> Array:
        """Covariances of the stated noise level, (n, 6, 6), [m, rad]."""
        level = self.results.noise_level
        return np.tile(np.diag((np.repeat([level.mm, level.deg], 3) * LEVEL_UNITS) ** 2), (n, 1, 1))

    def _restate(self, observation: Observation, cameras: Array, fitted: MeasuredNoise) -> Observation:
        """State the fitted errors, which are those of the origins of the models.

        Args:
            cameras: (n, 4, 4), the camera of each estimate, world.
        """
        operations = observation.assembly.operations
        offsets = np.array([self.results.description.offset(self.scene.parts[each.main]) for each in operations])
        of_models = replace(observation, poses=observation.poses @ offsets)
        each = [restate_covariance(of_models, fitted, Camera(T)).covariance[k] for k, T in enumerate(cameras)]
        # a body twist xi of the model is Ad(offset) xi of the part
        Ad = pose.adjoint(offsets)
        C = Ad @ np.array(each) @ np.swapaxes(Ad, 1, 2)
        return replace(observation, covariance=(C + np.swapaxes(C, 1, 2)) / 2)


class _Estimate(NamedTuple):
    """One estimate of a part."""

    T: Array
    """(4, 4), world, [m]."""
    score: float
    image: int


@lru_cache(maxsize=4)
def _read_rows(path: Path, changed_ns: int) -> PoseRows:
    """Read a results file once for all trials; `changed_ns` tells versions of the file apart."""
    return read_results(path)


def read_pose_results(path: Path, noise_level: NoiseLevel, fitted: MeasuredNoise | None = None) -> PoseResults:
    """Read the results of a pose estimator, and the description of the images that they are of.

    Raises:
        InputError: A file is missing or deviates from its format, or the results are of other images.
    """
    require(path.is_file(), f"there is no results file '{path}'; name one that exists.")
    folder = find_images(path)
    description = read_image_description(folder)
    rows = _read_rows(path, path.stat().st_mtime_ns)
    known = {(int(number), int(image)) for number, scene in description.scenes.items() for image in scene.images}
    for row, (scene, image, _) in enumerate(rows.where.tolist()):
        require(
            (scene, image) in known,
            f"{rows.location(row)}: the images in '{folder}' have no scene {scene} with image {image}.",
        )
    return PoseResults(str(path), folder, description, rows, noise_level, fitted)
