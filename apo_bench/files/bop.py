"""Pose estimates in the results format of the BOP benchmark, read line by line: mm, model to camera.

The first line is `scene_id,im_id,obj_id,score,R,t,time`; R is nine numbers row by row and t three, with spaces between.

Where parts truly were in images: a results file that holds the truth, or a `scene_gt.json` of the BOP format.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import JsonNode, check_separator, opened, parse_json, read_text

_COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
_WANTED = "needed are, in this order, " + ",".join(_COLUMNS)
_LONGEST_LINE = 4096
MOST_ROWS = 1_000_000
LARGEST_ID = 2**31 - 1
LARGEST_MM = 1e6
_NOT_A_ROTATION = 0.02
"""R R^t may be so far from the identity: published truth is rounded, that of LM-O by 0.0096."""
_METRES = 20.0
"""Parts whose median distance to the camera is less than this, in mm, were surely given in metres."""


@final
@dataclass(frozen=True, eq=False)
class PoseRows:
    """Parts in images, one row for each."""

    file: str
    where: NDArray[np.int64]
    """(n, 3): scene, image, object."""
    R: Array
    """(n, 3, 3), camera from model, as written: nearly rotations."""
    t_mm: Array
    """(n, 3), camera from model, axes of OpenCV."""
    place: NDArray[Any]
    """Where each row stands in the file: the line, or the entry of a JSON document."""
    score: Array
    """(n,), of the estimator; NaN where the file has none."""

    def spot(self, row: int) -> str:
        """Where a row stands, for messages."""
        return f"{self.file}, {self.where_in_file(row)}"

    def where_in_file(self, row: int) -> str:
        """The line, or the entry of a JSON document."""
        place = self.place[row]
        return str(place) if isinstance(place, str) else f"line {place}"


def read_results(path: str | Path) -> PoseRows:
    """The rows of a results file; times are checked and not kept.

    Raises:
        InputError: Anything that is not as described, with the line where it stands.
    """
    numbers = array("d")
    for row, (line, text) in enumerate(_lines(path)):
        place = f"{path}, line {line}"
        require(row != MOST_ROWS, f"{place}: a file of at most {MOST_ROWS} rows is needed; split it by scenes.")
        numbers.extend((line, *_row(text, place)))
    require(numbers, f"{path}: no pose stands in the file; below its first line, one row per pose is needed.")
    # Line, scene, image, object, score, R row by row, t: whole numbers of so many digits are exact.
    cells = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 17)
    whole = cells[:, :4].astype(np.int64)
    R = cells[:, 5:14].reshape(-1, 3, 3)
    return check_rows(PoseRows(str(path), whole[:, 1:], R, cells[:, 14:], whole[:, 0], cells[:, 4]))


def check_rows(rows: PoseRows) -> PoseRows:
    """The rows, once every pose in them makes sense.

    Raises:
        InputError: One is no rotation, the unit is not mm, or a row stands twice.
    """
    square = np.abs(rows.R @ np.swapaxes(rows.R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = (square > _NOT_A_ROTATION) | (np.linalg.det(rows.R) < 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        fault = f"R R^t differs from the identity by {square[k]:.3g}" if square[k] > _NOT_A_ROTATION else "it mirrors"
        raise InputError(f"{rows.spot(k)}, R: a rotation matrix, row by row, is needed; {fault}.")
    distance = np.linalg.norm(rows.t_mm, axis=1)
    require(
        np.median(distance) >= _METRES,
        f"{rows.spot(0)}, t: millimetres are needed, and the median distance to the camera is "
        f"{np.median(distance):.3g}; if these are metres, multiply by 1000.",
    )
    _refuse_twice(rows)
    return rows


def _refuse_twice(rows: PoseRows) -> None:
    """Refuse the first row that is an earlier one once more, number by number."""
    cells = np.concatenate([rows.where.astype(np.float64), rows.t_mm, rows.R.reshape(-1, 9)], axis=1)
    order = np.lexsort(cells.T[::-1])
    same = np.flatnonzero((cells[order[1:]] == cells[order[:-1]]).all(axis=1))
    if same.size:
        i = same[np.argmin(order[same + 1])]
        first = int(order[i])
        again = int(order[i + 1])
        raise InputError(
            f"{rows.spot(again)}: the row of {rows.where_in_file(first)} stands there once more; keep one of the two."
        )


def _lines(path: str | Path) -> Iterator[tuple[int, str]]:
    """Number and text of every line below the first that is not empty."""
    line = 0
    try:
        with opened(path, "CSV file") as stream:
            for line, raw in enumerate(iter(lambda: stream.readline(_LONGEST_LINE + 1), b""), start=1):
                require(
                    len(raw) <= _LONGEST_LINE,
                    f"{path}, line {line}: a line of at most {_LONGEST_LINE} characters is needed.",
                )
                text = raw.decode("utf-8-sig" if line == 1 else "utf-8").strip()
                if line == 1:
                    _check_header(text, f"{path}, line 1")
                elif text:
                    yield line, text
    except UnicodeDecodeError as error:
        raise InputError(f"{path}, line {line}: this is not UTF-8 text; give a CSV file.") from error
    require(line, f"{path}: the file is empty; {_WANTED} in its first line.")


def _check_header(text: str, place: str) -> None:
    columns = tuple(cell.strip() for cell in text.split(","))
    if columns == _COLUMNS:
        return
    check_separator(place, columns)
    for column in _COLUMNS:
        require(column in columns, f"{place}: the column '{column}' is missing; {_WANTED}.")
    raise InputError(f"{place}: the columns are {text[:80]}; {_WANTED}.")


def _row(text: str, place: str) -> tuple[float, ...]:
    """Scene, image, object, score and the twelve numbers of R and t."""
    cells = text.split(",")
    require(
        len(cells) == len(_COLUMNS),
        f"{place}: {len(_COLUMNS)} cells are needed, one for each column, {len(cells)} were given.",
    )
    scene, image, part = (_id(cell.strip(), place, name) for cell, name in zip(cells, _COLUMNS[:3], strict=False))
    (score,) = _numbers(cells[3], 1, f"{place}, score")
    pose = _numbers(cells[4], 9, f"{place}, R") + _numbers(cells[5], 3, f"{place}, t")
    _numbers(cells[6], 1, f"{place}, time")
    return scene, image, part, score, *pose


def _id(text: str, place: str, name: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 10 and int(text) <= LARGEST_ID):
        raise InputError(f"{place}, {name}: a whole number from 0 is needed, '{text[:40]}' was given.")
    return int(text)


def _numbers(text: str, count: int, place: str) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) == count and all(-LARGEST_MM <= x <= LARGEST_MM for x in values) and "_" not in text:
        return values
    what = "a number" if count == 1 else f"{count} numbers with spaces between them"
    stands = (
        f"{len(values)} numbers were given" if len(values) not in (0, count) else f"'{text.strip()[:40]}' was given"
    )
    raise InputError(f"{place}: {what} of at most {LARGEST_MM:g} is needed, {stands}.")


LARGEST_TRUTH_BYTES = 64_000_000
"""A scene of a video in the BOP format has up to some 20 MB."""


def read_truth(path: str | Path, estimates: PoseRows, scene: int | None = None) -> PoseRows:
    """The truth that estimates are compared with.

    A `.json` file holds one scene, and does not say which: it is `scene`, else the number of its folder, else the only
    scene that was estimated. It holds all images of that scene, so those with no estimate at all are left out, as they
    were probably not asked for. A folder holds scenes, as `000001/scene_gt.json`. Every row of a `.csv` file was asked
    for.

    Args:
        scene: Only this one.

    Raises:
        InputError: Anything that is not as described; no image of the truth has an estimate.
    """
    path = Path(path)
    of_scenes = path.is_dir() or path.suffix.lower() == ".json"
    if path.is_dir():
        truth = _read_folder(path, scene)
    elif of_scenes:
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
    kept = estimated_rows if of_scenes else np.ones(len(estimated_rows), dtype=np.bool_)
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
    return PoseRows(rows.file, rows.where[kept], rows.R[kept], rows.t_mm[kept], rows.place[kept], rows.score[kept])


def _among(where: Any, known: Any) -> Any:
    """Whether each pair (n, 2) is one of the known, -> (n,)."""
    size = LARGEST_ID + 1
    return np.isin(where[:, 0] * size + where[:, 1], known[:, 0] * size + known[:, 1])


def _which_scene(path: Path, estimates: PoseRows) -> int:
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
    """The truth of all scenes in a folder, or of one of them."""
    found = [file for file in sorted(path.glob("*/scene_gt.json")) if _is_number(file.parent.name)]
    files = [file for file in found if scene in (None, int(file.parent.name))]
    require(
        files,
        f"{path}: the folder holds no scene_gt.json in a folder that is numbered "
        f"{'as its scene' if scene is None else scene}, such as 000001; give a folder of scenes, or one scene_gt.json.",
    )
    scenes = list[PoseRows]()
    for file in files:
        scenes.append(_read_scene(file, int(file.parent.name)))
        count = sum(len(rows.where) for rows in scenes)
        require(count <= MOST_ROWS, f"{file}: scenes of at most {MOST_ROWS} parts are needed; choose by --scene-id.")
    return PoseRows(
        str(path),
        where=np.concatenate([rows.where for rows in scenes]),
        R=np.concatenate([rows.R for rows in scenes]),
        t_mm=np.concatenate([rows.t_mm for rows in scenes]),
        place=np.array([f"{rows.where[0, 0]:06}, {at}" for rows in scenes for at in rows.place]),
        score=np.concatenate([rows.score for rows in scenes]),
    )


def _is_number(name: str) -> bool:
    """Whether a folder is named by the number of its scene."""
    return name.isascii() and name.isdigit() and len(name) <= 9


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
