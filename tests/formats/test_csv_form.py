"""Observed poses as comma-separated values: what is understood, what comes back, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import apo_bench
from apo_bench import InputError, load_scenario
from apo_bench.formats.csv_form import read_table
from apo_bench.formats.json_forms import write_form
from apo_bench.formats.observation import read_observation_file
from apo_bench.formats.observation_json import make_observation_form
from apo_bench.geometry import pose

SCENARIO = load_scenario("stick_in_tower")
HEADER = "operation,part,x_mm,y_mm,z_mm,qw,qx,qy,qz"
ROWS = (HEADER, "1,castle1,120,20,0,1,0,0,0", "2,castle2,121,20,80,0,1,0,0", "3,stick,119,20.5,40,1,0,0,0")


def written(folder: Path, *lines: str) -> Path:
    path = folder / "seen.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_millimetres_and_wxyz(tmp_path: Path) -> None:
    seen, assumed = read_table(written(tmp_path, *ROWS), SCENARIO, (2.0, 0.5))
    expected = [pose.at((0.120, 0.020, 0)), pose.at((0.121, 0.020, 0.080), (180, 0, 0)), pose.at((0.119, 0.0205, 0.04))]
    assert seen.poses == pytest.approx(np.array(expected), abs=1e-15)
    assert np.sqrt(np.diagonal(seen.covariance, axis1=1, axis2=2)) == pytest.approx(
        np.tile([2e-3] * 3 + [np.radians(0.5)] * 3, (3, 1))
    )
    assert (assumed, bool(seen.observed.all()), seen.gap_m, seen.play_m) == (True, True, 1e-4, 2.5e-4)


def test_columns_are_known_by_their_names(tmp_path: Path) -> None:
    """Metres, quaternions with w last, any order of columns and rows, and what spreadsheets add to a file."""
    other = tmp_path / "other.csv"
    other.write_bytes(
        b"\xef\xbb\xbfpart, operation, qx, qy, qz, QW, z_m, y_m, x_m, seen\r\n"
        b"stick,3,0,0,0,1,0.04,0.0205,0.119,yes\r\n\r\n"
        b'"castle1",1,0,0,0,1,0,0.02,0.12,\r\n'
        b"castle2,2,1,0,0,0,0.08,0.02,0.121,false\r\n"
    )
    seen, _ = read_table(other, SCENARIO, (1.0, 1.0))
    assert seen.poses == pytest.approx(read_table(written(tmp_path, *ROWS), SCENARIO, (1.0, 1.0))[0].poses, abs=1e-15)
    assert seen.observed.tolist() == [True, False, True]


def test_deviations_are_read_where_they_are_stated(tmp_path: Path) -> None:
    cells = zip(ROWS[1:], ("0.1,3", ",3", "0.2,"), strict=True)
    lines = [f"{HEADER},deviation_rad,deviation_mm", *(f"{row},{deviations}" for row, deviations in cells)]
    seen, assumed = read_table(written(tmp_path, *lines), SCENARIO, (1.0, 1.0))
    found = np.sqrt(np.diagonal(seen.covariance, axis1=1, axis2=2))[:, [0, 3]]
    assert found == pytest.approx(np.array([[3e-3, 0.1], [3e-3, np.radians(1.0)], [1e-3, 0.2]]))
    assert assumed
    full = [f"{HEADER},deviation_mm,deviation_deg", *(f"{row},2,1" for row in ROWS[1:])]
    assert not read_table(written(tmp_path, *full), SCENARIO, (1.0, 1.0))[1]


def test_json_and_csv_say_the_same(tmp_path: Path) -> None:
    seen = read_observation_file(written(tmp_path, *ROWS), "stick_in_tower").observation
    path = tmp_path / "seen.json"
    write_form(make_observation_form(seen, "stick_in_tower"), path)
    again = apo_bench.read_observation(path, SCENARIO)
    assert again.poses == pytest.approx(seen.poses, abs=1e-15)
    assert again.covariance == pytest.approx(seen.covariance, rel=1e-12, abs=1e-20)
    assert (again.gap_m, again.play_m) == pytest.approx((seen.gap_m, seen.play_m))
    assert all(again.start[part] == pytest.approx(T, abs=1e-15) for part, T in seen.start.items())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({0: HEADER.replace(",z_mm", "")}, "line 1: the column 'z_mm' is missing"),
        ({0: HEADER.replace(",", ";")}, "line 1: columns are separated by commas; this file uses ';', so save it with"),
        ({2: "2,castle2,121,20,80,0,1,0"}, "line 3: 9 cells are needed, 8 were given."),
        ({2: "2,castle2,nan,20,80,0,1,0,0"}, "line 3, column x_mm: a number of at most 1e+07 is needed, 'nan'"),
        ({2: "2,castle2,1,2,80,0,0,0,0"}, "line 3, columns qw to qz: a quaternion of length 1 (within 0.001)"),
        ({2: "4,castle2,121,20,80,0,1,0,0"}, "line 3, column operation: a whole number from 1 to 3 is needed, '4'"),
        ({2: '2,"castle2,121'}, "this is not a CSV file"),
        ({0: "", 1: "", 2: "", 3: ""}, "the file is empty; its first line names the columns: operation, part, x_mm"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path: Path, change: dict[int, str], message: str) -> None:
    path = written(tmp_path, *(change.get(i, row) for i, row in enumerate(ROWS)))
    with pytest.raises(InputError) as raised:
        read_table(path, SCENARIO, (1.0, 1.0))
    said = str(raised.value)
    assert said.startswith(f"{path}")
    assert message in said
    assert said.endswith(".")
    assert "\n" not in said


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        ("deviation_mm", "0", "column deviation_mm: a standard deviation from 0.0001 to 10000 is needed, '0' was"),
        ("seen", "maybe", "column seen: true or false is needed, 'maybe' was given."),
        ("play_mm", "-0.3", "column play_mm: one length from 0 for all rows is needed, '-0.3' was given"),
    ],
)
def test_what_may_be_left_out_is_checked_if_it_is_not(tmp_path: Path, column: str, cell: str, message: str) -> None:
    path = written(tmp_path, f"{HEADER},{column}", *(f"{row},{cell}" for row in ROWS[1:]))
    with pytest.raises(InputError) as raised:
        read_table(path, SCENARIO, (1.0, 1.0))
    assert f"line 2, {message}" in str(raised.value)
