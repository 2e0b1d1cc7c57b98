"""Estimates and truth of the BOP formats: what is understood, how they are matched, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import InputError
from apo_bench.formats.bop import read_results
from apo_bench.formats.bop_truth import read_truth
from apo_bench.perception.observation.models import residuals
from apo_bench.perception.observation.models.residuals import match_residuals
from tests import bop_made as made_of
from tests.bop_made import HEADER, Known, Made

ONE = "1 0 0 0 1 0 0 0 1"
ROW = f"1,7,3,0.5,{ONE},10 20 900,0.1"


@pytest.fixture(scope="module")
def made() -> Made:
    return made_of.draw(300, Known(), np.random.default_rng(1))


def written(folder: Path, *lines: str, name: str = "estimates.csv") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_rows_are_read_in_mm_model_to_camera(tmp_path: Path) -> None:
    turned = "0 -1 0 1 0 0 0 0 1"
    path = tmp_path / "a.csv"
    path.write_bytes(
        b"\xef\xbb\xbf" + f"{HEADER}\r\n\r\n{ROW}\r\n 2 , 8,4,1e-3,{turned}, -1.5  2e2 1000,-1\r\n".encode()
    )
    read = read_results(path)
    assert_array_equal(read.where, [[1, 7, 3], [2, 8, 4]])
    assert_array_equal(read.t_mm, [[10, 20, 900], [-1.5, 200, 1000]])
    assert_array_equal(read.R[1], [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert_array_equal(read.score, [0.5, 1e-3])
    assert read.location(1) == f"{path}, line 4"


def test_planted_errors_come_back(tmp_path: Path, made: Made) -> None:
    """In the frame of each ray, for every part that was found, whatever the order of rows; the rest is missed."""
    estimates, truth = made_of.files(tmp_path, made)
    lines = estimates.read_text(encoding="utf-8").splitlines()
    order = np.random.default_rng(0).permutation(len(lines) - 1)
    estimates.write_text("\n".join([lines[0], *(lines[1 + i] for i in order)]), encoding="utf-8")
    seen = read_results(estimates)
    found = match_residuals(seen, read_truth(truth, seen))
    assert_array_equal(found.is_estimated, made.found)
    assert_allclose(found.shift_mm[made.found], made.shift[made.found], atol=1e-4)
    assert_allclose(found.turn_deg[made.found], made.turn[made.found], atol=1e-4)
    assert_allclose(found.trace_deg[made.found], found.angle_deg[made.found], atol=0.02)
    assert np.isnan(found.shift_mm[~made.found]).all()
    assert found.surplus == 0


def test_every_part_gets_an_estimate_of_its_own(tmp_path: Path) -> None:
    """Two alike, three estimates: the pairs that add up to the least, not the nearest one twice."""
    at = np.array([[0.0, 0, 900], [20, 0, 900]])
    seen = np.array([[30.0, 0, 900], [-400.0, 0, 900], [15.0, 0, 900]])
    R = np.tile(np.eye(3), (3, 1, 1))
    where = np.ones((3, 3), dtype=int)
    estimates = read_results(made_of.results(tmp_path / "e.csv", where, R, seen))
    truth = read_results(made_of.results(tmp_path / "t.csv", where[:2], R[:2], at))
    assert_array_equal(residuals.match_rows(estimates, truth), [2, 0])
    assert match_residuals(estimates, truth).surplus == 1


BAD = {
    "empty": ([], "no pose stands in the file"),
    "missing column": ([HEADER.replace(",time", ""), ROW], "line 1: the columns are scene_id.*; needed are scene_id"),
    "swapped": ([HEADER, f"1,7,3,0.5,10 20 900,{ONE},0.1"], "line 2: score, R, t and time are 1, 9, 3 and 1 numbers"),
    "not a rotation": ([HEADER, ROW, f"1,8,3,0.5,{ONE[:-1]}2,1 2 900,1"], "line 3, R: a rotation .* identity by 3"),
    "twice": ([HEADER, ROW, ROW.replace("7", "8"), ROW], "line 4: an earlier row stands there once more"),
}


@pytest.mark.parametrize("case", BAD)
def test_malformed_results_are_refused_with_the_line(case: str, tmp_path: Path) -> None:
    lines, message = BAD[case]
    path = tmp_path / "estimates.csv"
    path.write_bytes("".join(f"{line}\n" for line in lines).encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=message) as raised:
        read_results(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


ENTRY = {"obj_id": 3, "cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [10, 20, 900]}


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({}, "no pose stands in the file"),
        ({"7": [{"obj_id": 3}]}, "image 7, entry 1: the key 'cam_R_m2c' is missing"),
        ({"7": [{**ENTRY, "cam_R_m2c": [2, 0, 0, 0, 1, 0, 0, 0, 1]}]}, "image 7, entry 1, R: a rotation matrix"),
        ({"8": [ENTRY]}, "no image of scene 1 has an estimate in"),
    ],
)
def test_malformed_truth_is_refused_with_the_entry(document: Any, message: str, tmp_path: Path) -> None:
    path = tmp_path / "scene_gt.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_truth(path, read_results(written(tmp_path, HEADER, ROW)), 1)


def test_estimates_of_scenes_without_truth_are_no_false_detections(tmp_path: Path) -> None:
    made = made_of.draw(90, Known(missed=0.0), np.random.default_rng(3))
    where = made.where + np.column_stack([np.arange(90) // 30, np.zeros((90, 2), dtype=int)])
    seen = read_results(made_of.results(tmp_path / "seen.csv", where, made.R_seen, made.t_seen))
    for scene in (1, 2, 3):
        folder = tmp_path / "val" / f"{scene:06}"
        folder.mkdir(parents=True)
        each = where[:, 0] == scene
        made_of.scene_gt(folder / "scene_gt.json", where[each], made.R[each], made.t[each])
        (folder / "scene_gt_cam1.json").write_text("not read", encoding="utf-8")
    one = match_residuals(seen, read_truth(tmp_path / "val" / "000002" / "scene_gt.json", seen))
    assert (len(one.where), one.surplus, one.absent) == (30, 0, 0)
    whole = read_truth(tmp_path / "val", seen)
    assert match_residuals(seen, whole).surplus == 0
    assert whole.where.tolist() == where.tolist()
    assert whole.location(31).endswith("val, 000002, image 6, entry 2")
    assert read_truth(tmp_path / "val", seen, 3).where[:, 0].tolist() == [3] * 30
    with pytest.raises(InputError, match=r"holds no scene_gt\.json in a folder that is numbered 7, such as 000001"):
        read_truth(tmp_path / "val", seen, 7)
    assert match_residuals(seen, read_truth(tmp_path / "val" / "000001", seen)).surplus == 0
