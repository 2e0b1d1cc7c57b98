"""Where parts truly were in images: a results file that holds the truth, or a `scene_gt.json` of the BOP format."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.files.bop import LARGEST_ID, LARGEST_MM, PoseRows, check_rows, read_results
from apo_bench.io import JsonNode, parse_json, read_text

LARGEST_TRUTH_BYTES = 8_000_000


def read_truth(path: str | Path, estimates: PoseRows, scene: int | None = None) -> PoseRows:
    """The truth that estimates are compared with.

    A `.json` file holds one scene, and does not say which: it is `scene`, else the number of its folder, else the only
    scene that was estimated. It holds all images of that scene, so those with no estimate at all are left out, as they
    were probably not asked for. Every row of a `.csv` file was asked for.

    Args:
        scene: Only this one.

    Raises:
        InputError: Anything that is not as described; no image of the truth has an estimate.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        scene = _which_scene(path, estimates) if scene is None else scene
        truth = _read_scene(path, scene)
    else:
        truth = read_results(path)
    estimated_rows = _among(truth.where[:, :2], estimates.where[:, :2])
    if scene is not None:
        estimated_rows &= truth.where[:, 0] == scene
    if not estimated_rows.any():
        s, i = truth.where[0, :2]
        raise InputError(
            f"{path}: no image of {'the truth' if scene is None else f'scene {scene}'} has an estimate in "
            f"{estimates.file}; the first of the truth is image {i} of scene {s}; give the truth of the "
            "images that were estimated."
        )
    kept = estimated_rows if path.suffix.lower() == ".json" else np.ones(len(estimated_rows), dtype=np.bool_)
    if scene is not None:
        kept &= truth.where[:, 0] == scene
    truth = _only(truth, kept)
    behind = truth.t_mm[:, 2] <= 0.0
    if behind.any():
        k = int(np.argmax(behind))
        raise InputError(f"{truth.spot(k)}, t: the third number is the depth before the camera and must be above 0.")
    return truth


def _only(rows: PoseRows, kept: Any) -> PoseRows:
    """The rows of a mask."""
    where = rows.where[kept]
    return PoseRows(rows.file, where, rows.R[kept], rows.t_mm[kept], rows.place[kept], rows.score[kept])


def _among(where: Any, known: Any) -> Any:
    """Whether each pair (n, 2) is one of the known, -> (n,)."""
    size = LARGEST_ID + 1
    return np.isin(where[:, 0] * size + where[:, 1], known[:, 0] * size + known[:, 1])


def _which_scene(path: Path, estimates: PoseRows) -> int:
    folder = path.resolve().parent.name
    if folder.isascii() and folder.isdigit() and len(folder) <= 9:
        return int(folder)
    scenes = np.unique(estimates.where[:, 0])
    if len(scenes) > 1:
        named = ", ".join(str(s) for s in scenes[:6]) + (", ..." if len(scenes) > 6 else "")
        raise InputError(
            f"{path}: the file does not say which scene it is of, and the estimates are of {named}; "
            "name it with --scene-id."
        )
    return int(scenes[0])


def _read_scene(path: Path, scene: int) -> PoseRows:
    rows = list(_entries(parse_json(read_text(path, "JSON file of one scene", LARGEST_TRUTH_BYTES), str(path)), scene))
    require(rows, f"{path}: no pose stands in the file; give the scene_gt.json of a scene with parts.")
    where, R, t, place = zip(*rows, strict=True)
    score = np.full(len(rows), np.nan)
    return check_rows(
        PoseRows(str(path), np.array(where, dtype=np.int64), np.array(R), np.array(t), np.array(place), score)
    )


def _entries(root: JsonNode, scene: int) -> Iterator[tuple[tuple[int, int, int], Any, Any, str]]:
    """Every entry: its scene, image and object, R (3, 3), t (3,), and where it stands."""
    root.require(isinstance(root.value, dict), "an object is needed whose keys are the numbers of images")
    for image, entries in root.value.items():
        require(
            image.isascii() and image.isdigit() and len(image) <= 9,
            f"{root.file}: the keys are numbers of images, '{image[:40]}' was given.",
        )
        for i, entry in enumerate(root.child(entries, f"image {image}").items("entry"), start=1):
            place = f"image {image}, entry {i}"
            node = JsonNode(entry.value, root.file, place)
            part = _member(node, "obj_id").integer()
            _member(node, "obj_id").require(0 <= part <= LARGEST_ID, "a whole number from 0 is needed")
            R = _member(node, "cam_R_m2c").numbers(9).reshape(3, 3)
            t = _member(node, "cam_t_m2c").numbers(3)
            node.require(
                max(np.abs(R).max(), np.abs(t).max()) <= LARGEST_MM, f"numbers of at most {LARGEST_MM:g} are needed"
            )
            yield (scene, int(image), part), R, t, place


def _member(node: JsonNode, key: str) -> JsonNode:
    """A member of an entry; others than those of the format are nobody's business."""
    require(
        isinstance(node.value, dict) and key in node.value,
        f"{node.file}, {node.key}: the key '{key}' is missing; needed are obj_id, cam_R_m2c, cam_t_m2c.",
    )
    return node.child(node.value[key], key)
