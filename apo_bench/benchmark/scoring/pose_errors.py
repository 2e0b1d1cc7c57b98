"""Recall of pose estimates by the definitions of the BOP benchmark: VSD, MSSD, MSPD and ADD(-S).

After T. Hodan et al., BOP Challenge 2020 on 6D object localization, ECCV Workshops 2020, and S. Hinterstoisser et al.,
Model based training, detection and pose estimation of texture-less 3D objects in heavily cluttered scenes, ACCV 2012.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.benchmark.scoring.visible_surface import TOLERANCES, DepthView, compute_discrepancies
from apo_bench.formats.bop import PoseRows
from apo_bench.formats.bop_images import LEAST_VISIBLE, MODELS_INFO, TRUTH, VISIBILITY, ImageDescription, read_cameras
from apo_bench.formats.bop_models import ObjectSymmetry, read_symmetries
from apo_bench.geometry import Array, pose
from apo_bench.io import group_by, read_plain
from apo_bench.simulation.sensor.depth_images import make_model_rays, read_distances
from apo_bench.simulation.sensor.rays import ModelRays

_SHARES = np.arange(1, 11) * 0.05
"""Thresholds of VSD, and those of MSSD relative to the diameter of the object."""
_PIXELS = np.arange(1, 11) * 5.0
"""Thresholds of MSPD for an image 640 pixels wide, [pixels]."""
_WIDTH_PX = 640.0
_ADD_SHARES = np.array([0.1])
"""Threshold of ADD(-S), relative to the diameter."""
_THRESHOLDS = (*[_SHARES] * len(TOLERANCES), _SHARES, _PIXELS, _ADD_SHARES)
"""Thresholds of each error of a pair: VSD for each of its tolerances, MSSD, MSPD and ADD(-S)."""
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
    vsd: float
    """Visible surface discrepancy, mean over ten tolerances, 5 to 50 % of the diameter, and thresholds, 0.05 to 0.5."""
    mssd: float
    """Maximum symmetry-aware surface distance, mean over ten thresholds from 5 to 50 % of the diameter."""
    mspd: float
    """Maximum symmetry-aware projection distance, mean over ten thresholds from 5 to 50 pixels at a width of 640."""
    add: float
    """ADD, of symmetric objects ADD-S, below 10 % of the diameter."""


RECALLS = PoseRecall._fields[1:]
"""Names of the recalls."""


class _Target(NamedTuple):
    """The visible instances of an object in an image, and their estimates."""

    number: int
    """Of the object."""
    true: Array
    """(k, 4, 4), camera from model, [mm]."""
    estimated: Array
    """(j, 4, 4), those of the best scores, at most k."""
    K: Array
    """The camera matrix, (3, 3), [pixels]."""
    image: DepthView


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
    casts: dict[tuple[str, float], ModelRays] = {}
    hits: dict[str, list[Array]] = {}
    for number, scene in description.scenes.items():
        key = scene.scenario, scene.clearance_mm
        casts[key] = casts.get(key) or make_model_rays(scene)
        for target in _list_targets(folder, description, int(number), rows, casts[key]):
            errors = _list_errors(target, models[target.number], description)
            hits.setdefault(scene.scenario, []).append(_count_hits(errors))
    recall = {}
    for scenario, found in hits.items():
        counts = np.sum(found, axis=0)
        shares = counts[1:] / counts[0]
        recall[scenario] = PoseRecall(int(counts[0]), float(shares[: len(TOLERANCES)].mean()), *shares[-3:].tolist())
    return recall


def _list_errors(target: _Target, model: EvaluatedModel, description: ImageDescription) -> Array:
    """The errors of each pair of a true pose and an estimate, (k, j, 13), in the order of `_THRESHOLDS`."""
    to_part = pose.inverse(description.offset(target.number))
    true, estimated = (pose.rigid(T[:, :3, :3], 1e-3 * T[:, :3, 3]) @ to_part for T in (target.true, target.estimated))
    hidden = compute_discrepancies(target.image, target.number, true, estimated, 1e-3 * model.diameter_mm)
    errors = compute_errors(target.true, target.estimated, model, target.K)
    errors[..., 1] *= _WIDTH_PX / description.options.width
    return np.concatenate([hidden, errors], axis=2)


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
    folder: Path, description: ImageDescription, scene: int, rows: PoseRows, cast: ModelRays
) -> Iterator[_Target]:
    """Yield the visible objects in the images of a scene."""
    place = folder / description.split / f"{scene:06d}"
    if not place.is_dir():
        return
    truth = json.loads((place / TRUTH).read_text(encoding="utf-8"))
    facts = json.loads((place / VISIBILITY).read_text(encoding="utf-8"))
    cameras = read_cameras(place)
    for name in description.scenes[str(scene)].images:
        image = int(name)
        view = DepthView(*read_distances(place / "depth" / f"{image:06d}.png", cameras[image]), cast)
        pairs = zip(truth[name], facts[name], strict=True)
        visible = ((entry["obj_id"], entry) for entry, fact in pairs if fact["visib_fract"] >= LEAST_VISIBLE)
        for number, entries in group_by(visible).items():
            T = pose.rigid([np.reshape(e["cam_R_m2c"], (3, 3)) for e in entries], [e["cam_t_m2c"] for e in entries])
            found = np.flatnonzero((rows.where == (scene, image, number)).all(axis=1))
            best = found[np.argsort(-rows.score[found], kind="stable")[: len(entries)]]
            yield _Target(number, T, pose.rigid(rows.R[best], rows.t_mm[best]), cameras[image].K, view)


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
    """(14,): number of true poses, and how many are matched by each error, as means over its thresholds.

    Args:
        errors: (k, j, 13), of k true poses and j estimates, the best score first, in the order of `_THRESHOLDS`.
    """
    matched = [
        np.mean([count_matches(errors[:, :, i], limit) for limit in limits]) for i, limits in enumerate(_THRESHOLDS)
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
