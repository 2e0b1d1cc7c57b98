"""A log reads back as it was written in every format, and what is wrong with one is said in a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.geometry import pose
from apo_bench.importers.recording.camera_file import Conventions, read_camera
from apo_bench.importers.recording.formats import read_log
from apo_bench.importers.recording.log_tables import read_text_tables
from apo_bench.importers.recording.matching import match_tracks
from apo_bench.importers.recording.objects_file import ObjectsFile, TrackedPart, read_objects
from tests.importers.recording.log_forms import FORMS, Tracked
from tests.recorded import CAMERA, motion


def tracked() -> dict[str, Tracked]:
    t, T = motion("block_on_block")
    model = pose.at((0.01, -0.02, 0.03), (20.0, -40.0, 60.0))
    return {
        part: Tracked(str(11 + i), model, t + 1.0, pose.inverse(CAMERA) @ x @ pose.inverse(model))
        for i, (part, x) in enumerate(T.items())
    }


@pytest.mark.parametrize("name", FORMS)
def test_every_format_gives_the_poses_that_were_written(name: str, tmp_path: Path) -> None:
    form = FORMS[name]
    written = tracked()
    form.write(written, tmp_path / form.file)
    (tmp_path / "camera.toml").write_text(f'schema = "apo-bench/camera/1"\n[log]\n{form.log}\n', encoding="utf-8")
    log = read_log(tmp_path / form.file, read_camera(tmp_path / "camera.toml").conventions, form.format)
    assert "not " + form.format not in " ".join(log.notes)
    for part in written.values():
        track = log.tracks[f"tracker/{part.id}" if name == "ros-json" else part.id]
        assert np.abs(track.T - part.T).max() < 1e-5  # files have seven digits, of up to 1500 mm
        assert np.abs(track.t - (part.t - part.t[0])).max() < 1e-5


def test_a_part_is_where_its_frame_lies_in_the_model(tmp_path: Path) -> None:
    written = tracked()
    FORMS["csv-wxyz"].write(written, tmp_path / "log.csv")
    frame = "at_mm = [10, -20, 30], turn_deg = [20, -40, 60]"
    parts = "\n".join(f'{part} = {{ id = "{track.id}", frame = {{ {frame} }} }}' for part, track in written.items())
    (tmp_path / "o.toml").write_text(f'schema = "apo-bench/objects/1"\n[objects]\n{parts}\n', encoding="utf-8")
    tracks = match_tracks(read_log(tmp_path / "log.csv", Conventions()), read_objects(tmp_path / "o.toml"), {}).tracks
    for part, T in motion("block_on_block")[1].items():
        assert np.abs(CAMERA @ tracks[part].T - T).max() < 1e-6


HEAD = "t_s,id,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
ROW = "0.1,a,0,0,900,1,0,0,0\n"
WRONG = [
    ("csv", "", "the file is empty"),
    ("csv", HEAD + "0.1,a,0,0,0.9,1,0,0,0\n", "0.9 mm, so its lengths are in another unit"),
    ("csv", HEAD + "0.1,a,0,0,900,1,1,0,0\n", "line 2: a quaternion of length 1 is needed"),
    ("csv", HEAD + "0.1,a,0,0,900\n", "line 2: 5 cells stand here, and 9 are needed"),
    ("csv", HEAD + "0.1,a,left,0,900,1,0,0,0\n", "column x: a number is needed, 'left' was given"),
    ("csv", HEAD + ROW + "0.0,a,0,0,900,1,0,0,0\n" * 2 + "-9,a,0,0,900,1,0,0,0\n", "runs backwards by 9.1 s"),
    ("csv", HEAD.replace("_mm", "") + ROW.replace("900", "9e9"), "the unit of the column 'x' is not known"),
    (
        "csv",
        HEAD.replace("qz", "speed") + ROW,
        "one rotation is missing; understood: t_s, id, x_mm, y_mm, z_mm, qw, qx, qy",
    ),
    ("json", '{"header": {"stamp": {"sec": 1}}}', "no pose is found"),
    ("json", "{", "this is not JSON"),
]


@pytest.mark.parametrize(("suffix", "text", "sentence"), WRONG)
def test_what_is_wrong_with_a_log_is_one_sentence(suffix: str, text: str, sentence: str, tmp_path: Path) -> None:
    (tmp_path / f"log.{suffix}").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_log(tmp_path / f"log.{suffix}", Conventions())
    assert sentence in str(error.value)
    assert str(error.value).startswith(str(tmp_path))
    assert str(error.value).endswith(".")


def test_lost_frames_are_counted_by_kind(tmp_path: Path) -> None:
    lost = "0.{k},a,0,0,0,1,0,0,0\n"
    log = tmp_path / "log.csv"
    rows = [HEAD, ROW, lost.format(k=2), "0.3,a,,,,,,,\n", ROW.replace("0.1", "0.4"), "0.5,a,nan,0,900,1,0,0,0\n"]
    log.write_text("".join(rows), encoding="utf-8")
    poses = read_log(log, Conventions()).candidates["a"]
    assert poses.t == pytest.approx([0.0, 0.3])
    assert poses.lost == {"not valid": 2, "zero or identity": 1}
    # What is there in every frame, such as the base in its own frame, was not lost.
    log.write_text(HEAD + ROW.replace("a", "b").replace("900", "1900") + lost.format(k=2), encoding="utf-8")
    assert len(read_log(log, Conventions()).tracks["a"].t) == 1


def test_broken_rows_are_counted_and_are_no_rate(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(
        HEAD + "".join(f"{0.1 * i},a,{i},0,900,1,0,0,0\n" for i in range(1, 20)) + "1,a\n"
    )
    assert read_log(tmp_path / "log.csv", Conventions()).broken == 1
    (table,) = read_text_tables(tmp_path / "log.csv", {})
    assert (table.rate_hz, table.broken) == (0.0, 1)


@pytest.mark.parametrize("key", ["matrix", "pose", "ob_in_cam", "TCO"])
def test_matrices_in_json_are_found_by_their_names(key: str, tmp_path: Path) -> None:
    T = pose.at((0.1, 0.2, 0.9), (10.0, 20.0, 30.0))
    rows = [{"time": 0.1 * i, "label": "a", key: T.tolist()} for i in range(3)]
    (tmp_path / "log.json").write_text(json.dumps(rows), encoding="utf-8")
    np.testing.assert_allclose(read_log(tmp_path / "log.json", Conventions()).tracks["a"].T, [T] * 3, atol=1e-12)


def test_matrices_in_rows_and_the_truth_of_a_scene_are_logs(tmp_path: Path) -> None:
    """KITTI, with one file for each object, and `scene_gt.json` of BOP; both count images."""
    T = np.array([pose.at((0.1 + 0.01 * k, 0.2, 0.9), (10.0, 20.0 + k, 30.0)) for k in range(5)])
    np.savetxt(tmp_path / "a.txt", T[:, :3].reshape(-1, 12))
    entry = [{"obj_id": 7, "cam_R_m2c": M[:3, :3].ravel().tolist(), "cam_t_m2c": (1e3 * M[:3, 3]).tolist()} for M in T]
    (tmp_path / "scene_gt.json").write_text(json.dumps({str(k): [each] for k, each in enumerate(entry)}))
    for file, name in (("a.txt", "a"), ("scene_gt.json", "7")):
        track = read_log(tmp_path / file, Conventions(rate_hz=10.0)).tracks[name]
        np.testing.assert_allclose(track.T, T, atol=1e-9)
        np.testing.assert_allclose(track.t, 0.1 * np.arange(5), atol=1e-12)


def test_a_huge_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("apo_bench.importers.recording.log_tables.LARGEST_LOG_BYTES", 1000)
    (tmp_path / "log.csv").write_text(HEAD + "".join(f"{i},a,0,0,900,1,0,0,0\n" for i in range(100)), encoding="utf-8")
    with pytest.raises(InputError, match=r"larger than 0\.001 MB; give a log"):
        read_log(tmp_path / "log.csv", Conventions())


def test_an_id_that_is_no_part_and_a_part_without_its_id_are_named(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(HEAD + ROW + ROW.replace("a", "c"), encoding="utf-8")
    log = read_log(tmp_path / "log.csv", Conventions())
    (tmp_path / "o.toml").write_text(
        'schema = "apo-bench/objects/1"\n[objects]\npeg = { id = "a" }\nhole = { id = 3 }\n', encoding="utf-8"
    )
    matched = match_tracks(log, read_objects(tmp_path / "o.toml"), {})
    assert [*matched.tracks] == ["peg"]
    assert "the id 3 of 'hole' is not in the log" in matched.doubts
    assert matched.doubts[1].startswith("the id 'c' is no part, so its 1 poses")
    with pytest.raises(InputError, match="its ids are 'a', 'c'"):
        match_tracks(log, ObjectsFile("o.toml", {"peg": TrackedPart(("x",), np.eye(4), {})}, frozenset()), {})
