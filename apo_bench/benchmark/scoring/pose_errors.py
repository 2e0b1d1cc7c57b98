"""Recall of pose estimates by the definitions of the BOP benchmark: MSSD, MSPD and ADD(-S).

After T. Hodan et al., BOP Challenge 2020 on 6D object localization, ECCV Workshops 2020, and S. Hinterstoisser et al.,
Model based training, detection and pose estimation of texture-less 3D objects in heavily cluttered scenes, ACCV 2012.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.formats.bop import PoseRows
from apo_bench.formats.bop_images import LEAST_VISIBLE, MODELS_INFO, TRUTH, VISIBILITY, ImageDescription, read_cameras
from apo_bench.formats.bop_models import ObjectSymmetry, read_symmetries
from apo_bench.geometry import Array, pose
from apo_bench.io import read_plain

_SHARES = np.arange(1, 11) * 0.05
"""Thresholds of MSSD, relative to the diameter of the object; recall is the mean over them."""
_PIXELS = np.arange(1, 11) * 5.0
"""Thresholds of MSPD for an image 640 pixels wide, [pixels]; recall is the mean over them."""
_WIDTH_PX = 640.0
_ADD_SHARES = np.array([0.1])
"""Threshold of ADD(-S), relative to the diameter."""
_FEW_SYMMETRIES = 64  # up to so many, all vertices count
_NOTHING = ObjectSymmetry(np.eye(4)[None])


@final
@dataclass(frozen=True, eq=False)
class EvaluatedModel:
    """The model of an object for evaluation."""

    vertices: Array
    """(n, 3), [mm]."""
    corners: Array
    """(k, 3), those for MSSD and MSPD, [mm]: with many symmetries only the corners of the convex hull. No other vertex
    moves farther, and in the image none by more than the perspective within the part."""
    diameter_mm: float
    symmetries: Array
    """(m, 4, 4), displacements after which it looks the same, the identity first, [mm]."""


class PoseRecall(NamedTuple):
    """Recall of estimates, from 0 to 1."""

    targets: int
    """Number of visible parts in all images."""
    mssd: float
    """Maximum symmetry-aware surface distance, mean over ten thresholds from 5 to 50 % of the diameter."""
    mspd: float
    """Maximum symmetry-aware projection distance, mean over ten thresholds from 5 to 50 pixels at a width of 640."""
    add: float
    """ADD, of symmetric objects ADD-S, below 10 % of the diameter."""


def measure_recall(folder: Path, description: ImageDescription, rows: PoseRows) -> dict[str, PoseRecall]:
    """Measure recall of the estimates of each scenario.

    As in the BOP benchmark, only as many estimates of an object count in an image as there are visible instances, those
    of the best scores, and each is matched to one instance.

    Args:
        folder: Of the data set.

    Returns:
        Scenario -> recall; empty if the true poses are secret.
    """
    if description.secret_seed is not None:
        return {}
    models = _read_models(folder)
    width_px = description.options.width
    hits: dict[str, list[Array]] = {}
    for number, scene in description.scenes.items():
        for truth, seen, model, K in _list_targets(folder, description, int(number), rows, models):
            errors = compute_errors(truth, seen, model, K) * (1.0, _WIDTH_PX / width_px, 1.0)
            hits.setdefault(scene.scenario, []).append(_count_hits(errors))
    recall = {}
    for scenario, found in hits.items():
        counts = np.sum(found, axis=0)
        recall[scenario] = PoseRecall(int(counts[0]), *(counts[1:] / counts[0]).tolist())
    return recall


def _read_models(folder: Path) -> dict[int, EvaluatedModel]:
    import trimesh

    place = folder / "models_eval"
    known = read_symmetries(place / MODELS_INFO)
    models = {}
    for name, entry in read_plain(place / MODELS_INFO, "sizes of models", syntax="json").items():
        number = int(name)
        mesh: Any = trimesh.load(place / f"obj_{number:06d}.ply", process=False)
        symmetries = known.get(number, _NOTHING).images
        corners = (mesh if len(symmetries) <= _FEW_SYMMETRIES else mesh.convex_hull).vertices
        models[number] = EvaluatedModel(np.array(mesh.vertices), np.array(corners), entry["diameter"], symmetries)
    return models


def _list_targets(
    folder: Path, description: ImageDescription, scene: int, rows: PoseRows, models: Mapping[int, EvaluatedModel]
) -> Iterator[tuple[Array, Array, EvaluatedModel, Array]]:
    """Yield true poses (k, 4, 4) and estimates (j, 4, 4) of an object in an image, [mm], its model, and the camera."""
    place = folder / description.split / f"{scene:06d}"
    if not place.is_dir():
        return
    truth = json.loads((place / TRUTH).read_text(encoding="utf-8"))
    facts = json.loads((place / VISIBILITY).read_text(encoding="utf-8"))
    for image, camera in read_cameras(place).items():
        of_object: dict[int, list[Any]] = {}
        for entry, fact in zip(truth[str(image)], facts[str(image)], strict=True):
            if fact["visib_fract"] >= LEAST_VISIBLE:
                of_object.setdefault(entry["obj_id"], []).append(entry)
        for number, entries in of_object.items():
            T = pose.rigid([np.reshape(e["cam_R_m2c"], (3, 3)) for e in entries], [e["cam_t_m2c"] for e in entries])
            found = np.flatnonzero((rows.where == (scene, image, number)).all(axis=1))
            best = found[np.argsort(-rows.score[found], kind="stable")[: len(entries)]]
            yield T, pose.rigid(rows.R[best], rows.t_mm[best]), models[number], camera.K


def compute_errors(truth: Array, seen: Array, model: EvaluatedModel, K: Array) -> Array:
    """Errors of each pair of a true pose and an estimate, (k, j, 3): MSSD / diameter, MSPD [pixels], ADD / diameter."""
    errors = np.zeros((len(truth), len(seen), 3))
    for k, T in enumerate(truth):
        alike = pose.apply_all(T @ model.symmetries, model.corners)
        for j, estimate in enumerate(seen):
            points = pose.apply(estimate, model.corners)
            mssd = np.linalg.norm(alike - points, axis=2).max(axis=1).min()
            mspd = np.linalg.norm(_project(K, alike) - _project(K, points), axis=2).max(axis=1).min()
            errors[k, j] = mssd / model.diameter_mm, mspd, _compute_add(T, estimate, model) / model.diameter_mm
    return errors


def _compute_add(T: Array, estimate: Array, model: EvaluatedModel) -> float:
    """Mean distance of vertices; of a symmetric object that of each to the nearest one."""
    from scipy.spatial import KDTree

    true, points = (pose.apply(each, model.vertices) for each in (T, estimate))
    if len(model.symmetries) == 1:
        return float(np.linalg.norm(true - points, axis=1).mean())
    return float(KDTree(points).query(true)[0].mean())


def _project(K: Array, points: Array) -> Array:
    """Project points (*, 3) of the camera frame, (*, 2), [pixels]."""
    image = points @ K.T
    return np.asarray(image[..., :2] / image[..., 2:])


def _count_hits(errors: Array) -> Array:
    """(4,): number of true poses, and how many are matched by MSSD, MSPD and ADD, as means over thresholds.

    Args:
        errors: (k, j, 3), of k true poses and j estimates, the best score first.
    """
    matched = [
        np.mean([count_matches(errors[:, :, i], limit) for limit in limits])
        for i, limits in enumerate((_SHARES, _PIXELS, _ADD_SHARES))
    ]
    return np.array([len(errors), *matched])


def count_matches(errors: Array, limit: float) -> int:
    """The number of true poses (k) that one of the estimates (j) is nearest to, each estimate in turn."""
    free = np.ones(len(errors), dtype=np.bool_)
    for column in errors.T:
        nearest = int(np.argmin(np.where(free, column, np.inf)))
        if free[nearest] and column[nearest] < limit:
            free[nearest] = False
    return int(len(free) - free.sum())
