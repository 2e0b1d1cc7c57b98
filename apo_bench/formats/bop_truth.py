"""Read the ground truth of pose estimates: a results file, or `scene_gt.json` of the BOP format."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from apo_bench.errors import InputError, require
from apo_bench.formats.bop import LARGEST_ID, LARGEST_MM, PoseRows, check_rows, read_results
from apo_bench.io import convert_typed, read_typed

LARGEST_TRUTH_BYTES = 4_000_000_000
"""A scene of a video in BOP format takes up to about 20 MB; joined scenes take more."""
_SCENE = "scene_gt.json"  # name of the truth of a scene in its folder
_Number = Annotated[float, Meta(ge=-LARGEST_MM, le=LARGEST_MM)]
_Three = tuple[_Number, _Number, _Number]
# A rotation matrix, row by row.
_Nine = tuple[_Number, _Number, _Number, _Number, _Number, _Number, _Number, _Number, _Number]


class TruthEntry(msgspec.Struct, frozen=True):
    """The pose of an object in an image; other keys are ignored."""

    obj_id: Annotated[int, Meta(ge=0, le=LARGEST_ID)]
    cam_R_m2c: _Nine
    cam_t_m2c: _Three


def read_truth(path: str | Path, estimates: PoseRows, scene: int | None = None) -> PoseRows:
    """Return the ground truth with which estimates are compared.

    A `.json` file holds one scene without naming it: `scene`, else the number of its folder, else the only estimated
    scene. It holds all images of the scene; images without any estimate are left out, as they were probably not
    requested. A folder is a scene, or holds scenes as `000001/scene_gt.json`. All rows of a `.csv` file count.

    Args:
        scene: The only scene to compare; None: all.

    Raises:
        InputError: A file deviates from its format, or no image of the truth has an estimate.
    """
    path = Path(path)
    is_results = path.suffix.lower() == ".csv"
    if path.is_dir() and (path / _SCENE).is_file():
        path = path / _SCENE
    if path.is_dir():
        truth = _read_folder(path, scene)
    elif is_results:
        truth = read_results(path)
    else:
        scene = _which_scene(path, estimates) if scene is None else scene
        truth = _read_scene(path, scene)
    kept = truth.where[:, 0] == (truth.where[:, 0] if scene is None else scene)  # all rows if no scene is given
    estimated = kept & _among(truth.where[:, :2], estimates.where[:, :2])
    require(
        estimated.any(),
        f"{path}: no image of {'the truth' if scene is None else f'scene {scene}'} has an estimate in "
        f"{estimates.file}; give the truth of the images that were estimated.",
    )
    truth = _only(truth, kept if is_results else estimated)
    nearest = int(np.argmin(truth.t_mm[:, 2]))  # the row with the least depth
    require(
        truth.t_mm[nearest, 2] > 0.0,
        f"{truth.spot(nearest)}, t: the third number is the depth before the camera and must be above 0.",
    )
    return truth


def _only(rows: PoseRows, kept: Any) -> PoseRows:
    """Return the rows that a mask (n,) selects."""
    return PoseRows(rows.file, rows.where[kept], rows.R[kept], rows.t_mm[kept], rows.place[kept], rows.score[kept])


def _among(where: Any, known: Any) -> Any:
    """Return which scene-image pairs, (n, 2), are among known ones, (m, 2), as a mask (n,)."""
    size = LARGEST_ID + 1  # joins scene and image into one number
    return np.isin(where[:, 0] * size + where[:, 1], known[:, 0] * size + known[:, 1])


def _which_scene(path: Path, estimates: PoseRows) -> int:
    """Return the scene of a `.json` file: the number of its folder, else the only estimated scene."""
    folder = path.resolve().parent.name
    if _is_number(folder):
        return int(folder)
    scenes = np.unique(estimates.where[:, 0])
    if len(scenes) > 1:
        named = ", ".join(str(s) for s in scenes[:6]) + (", ..." if len(scenes) > 6 else "")
        raise InputError(
            f"{path}: the file does not say which scene it is of, and the estimates are of {named}; "
            "name it with --scene-id."
        )
    return int(scenes[0])


def _read_folder(path: Path, scene: int | None) -> PoseRows:
    """Return the ground truth of all scenes in a folder, or of one of them."""
    found = [file for file in sorted(path.glob("*/scene_gt.json")) if _is_number(file.parent.name)]
    files = [file for file in found if scene in (None, int(file.parent.name))]
    require(
        files,
        f"{path}: the folder holds no scene_gt.json in a folder that is numbered "
        f"{'as its scene' if scene is None else scene}, such as 000001; give a folder of scenes, or one scene_gt.json.",
    )
    scenes = [_read_scene(file, int(file.parent.name)) for file in files]
    return PoseRows(
        str(path),
        where=np.concatenate([rows.where for rows in scenes]),
        R=np.concatenate([rows.R for rows in scenes]),
        t_mm=np.concatenate([rows.t_mm for rows in scenes]),
        place=np.array([f"{rows.where[0, 0]:06}, {at}" for rows in scenes for at in rows.place]),
        score=np.concatenate([rows.score for rows in scenes]),
    )


def _is_number(name: str) -> bool:
    """Whether the name of a folder or a key is a number."""
    return name.isascii() and name.isdigit() and len(name) <= 9


def _read_scene(path: Path, scene: int) -> PoseRows:
    """Read the ground truth of one scene; scores are NaN."""
    images = read_typed(path, dict[str, Any], "truth of one scene", syntax="json", limit=LARGEST_TRUTH_BYTES)
    rows = list(_entries(path, images))
    require(rows, f"{path}: no pose stands in the file; give the scene_gt.json of a scene with parts.")
    where = [(scene, image, entry.obj_id) for image, _, entry in rows]
    R = np.array([entry.cam_R_m2c for _, _, entry in rows]).reshape(-1, 3, 3)
    t = np.array([entry.cam_t_m2c for _, _, entry in rows])
    place = np.array([at for _, at, _ in rows])
    score = np.full(len(rows), np.nan)
    return check_rows(PoseRows(str(path), np.array(where, dtype=np.int64), R, t, place, score))


def _entries(path: Path, images: dict[str, Any]) -> Iterator[tuple[int, str, TruthEntry]]:
    """Yield image, location and content of every entry."""
    for image, entries in images.items():
        require(_is_number(image), f"{path}: the keys are numbers of images, '{image[:40]}' was given.")
        for i, entry in enumerate(convert_typed(entries, list[TruthEntry], f"{path}, image {image}"), start=1):
            yield int(image), f"image {image}, entry {i}", entry
