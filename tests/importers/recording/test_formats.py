"""A log reads back as it was written in every format, and what is wrong with one is said in a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.geometry import pose
from apo_bench.importers.recording.camera_file import Conventions, read_camera
from apo_bench.importers.recording.formats import FORMATS, read_log
from apo_bench.importers.recording.objects_file import name_tracks, read_objects
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
    log = read_log(tmp_path / form.file, form.format, read_camera(tmp_path / "camera.toml").conventions)
    assert form.format in FORMATS
    for part in written.values():
        track = log.tracks[f"tracker/{part.id}" if name == "ros-json" else part.id]
        assert np.abs(track.T - part.T).max() < 1e-5  # files have seven digits, of up to 1500 mm
        assert np.abs(track.t - (part.t - part.t[0])).max() < 1e-5


def test_a_part_is_where_its_frame_lies_in_the_model(tmp_path: Path) -> None:
    written = tracked()
    FORMS["tum"].write(written, tmp_path / "log")
    frame = "at_mm = [10, -20, 30], turn_deg = [20, -40, 60]"
    parts = "\n".join(f'{part} = {{ id = "{track.id}", frame = {{ {frame} }} }}' for part, track in written.items())
    (tmp_path / "o.toml").write_text(f'schema = "apo-bench/objects/1"\n[objects]\n{parts}\n', encoding="utf-8")
    tracks = name_tracks(read_log(tmp_path / "log", "tum", Conventions()), read_objects(tmp_path / "o.toml"))
    for part, T in motion("block_on_block")[1].items():
        assert np.abs(CAMERA @ tracks[part].T - T).max() < 1e-6


HEAD = "t_s,id,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
ROW = "0.1,a,0,0,900,1,0,0,0\n"
WRONG = [
    ("csv", "", "the file is empty"),
    ("csv", HEAD + "0.1,a,0,0,0.9,1,0,0,0\n", "0.9 mm, so its lengths are in another unit"),
    ("csv", HEAD + "0.1,a,0,0,900,1,1,0,0\n", "line 2: a quaternion of length 1 is needed"),
    ("csv", HEAD.replace("_mm", "") + ROW, "the unit of the column 'x' is not known"),
    ("csv", HEAD.replace("qz", "q") + ROW, "the columns of one rotation are needed, 0 are complete"),
    ("csv", HEAD.replace(",", ";"), "columns are separated by commas; this file uses ';'"),
    ("ros-json", '{"header": {"stamp": {"sec": 1}}}', "the column 'x_mm' is missing"),
    ("ros-json", "{", "this is not JSON"),
]


@pytest.mark.parametrize(("form", "text", "sentence"), WRONG)
def test_what_is_wrong_with_a_log_is_one_sentence(form: str, text: str, sentence: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_log(tmp_path / "log.csv", form, Conventions())
    assert sentence in str(error.value)
    assert str(error.value).startswith(str(tmp_path))
    assert str(error.value).endswith(".")


def test_the_identity_among_other_poses_is_a_lost_frame(tmp_path: Path) -> None:
    lost = "0.{k},a,0,0,0,1,0,0,0\n"
    log = tmp_path / "log.csv"
    log.write_text(HEAD + ROW + lost.format(k=2) + lost.format(k=3) + "0.4,a,0,0,900,1,0,0,0\n", encoding="utf-8")
    read = read_log(log, "csv", Conventions())
    assert read.tracks["a"].t == pytest.approx([0.0, 0.3])
    assert read.notes[-1] == "2 poses that are the identity left out as lost frames"
    # What is there in every frame, such as the base in its own frame, was not lost.
    log.write_text(HEAD + ROW.replace("a", "b").replace("900", "1900") + lost.format(k=2), encoding="utf-8")
    assert len(read_log(log, "csv", Conventions()).tracks["a"].t) == 1


def test_a_huge_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("apo_bench.importers.recording.log_tables.LARGEST_LOG_BYTES", 1000)
    (tmp_path / "log.csv").write_text(HEAD + "".join(f"{i},a,0,0,900,1,0,0,0\n" for i in range(100)), encoding="utf-8")
    with pytest.raises(InputError, match=r"larger than 0\.001 MB; give a log"):
        read_log(tmp_path / "log.csv", "csv", Conventions())


def test_an_id_that_is_no_part_and_a_part_without_its_id_are_named(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(HEAD + ROW, encoding="utf-8")
    log = read_log(tmp_path / "log.csv", "csv", Conventions())
    for parts, sentence in (
        ('peg = { id = "b" }', "the id 'a' is no part"),
        ('peg = { id = "a" }\nhole = { id = 3 }', "'3'"),
    ):
        (tmp_path / "o.toml").write_text(f'schema = "apo-bench/objects/1"\n[objects]\n{parts}\n', encoding="utf-8")
        with pytest.raises(InputError, match=sentence):
            name_tracks(log, read_objects(tmp_path / "o.toml"))
