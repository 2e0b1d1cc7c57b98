"""Images of episodes in a LeRobot data set: videos with a frame for each action, as the table of episodes says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
from pyarrow import parquet

from apo_bench import InputError, TrialConfig
from apo_bench.benchmark.datasets.trial_dataset import make_dataset
from apo_bench.cli.app import main
from apo_bench.envs.policies import insert_env

pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg, of the extra film, is not installed")
CAMERAS = ("scene", "wrist")
TRIALS = [TrialConfig("block_on_block", method="contact", seed=1000000 + k) for k in range(2)]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("videos") / "data"
    assert make_dataset(TRIALS, out, "by hand", "lerobot", "straight", pixels=CAMERAS)[0] == 2
    return out


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def test_every_action_has_a_frame_where_the_tables_say(made: Path) -> None:
    info = read(made / "meta" / "info.json")
    episodes = parquet.read_table(made / "meta" / "episodes").to_pylist()
    for camera in CAMERAS:
        key = f"observation.images.{camera}"
        feature = info["features"][key]
        assert (feature["dtype"], feature["shape"], feature["info"]["video.codec"]) == ("video", [96, 96, 3], "h264")
        for episode in episodes:
            place = {name: episode[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
            path = made / info["video_path"].format(video_key=key, **place)
            assert imageio.imread(path).shape == (episode["length"], 96, 96, 3)
            assert imageio.immeta(path)["codec"] == "h264"
            assert imageio.immeta(path)["fps"] == info["fps"]
            seconds = episode[f"videos/{key}/to_timestamp"] - episode[f"videos/{key}/from_timestamp"]
            assert seconds == pytest.approx(episode["length"] / info["fps"])
    assert "observation.images.wrist" in (made / "README.md").read_text(encoding="utf-8")
    assert parquet.read_table(made / "meta" / "tasks.parquet")["task"].to_pylist() == [
        "Insert the part in the hand: a block on a block."
    ]


def test_the_first_frame_is_the_first_observation(made: Path) -> None:
    env = insert_env(TRIALS[1], "straight", pixels=CAMERAS)
    seen, _ = env.reset(seed=TRIALS[1].seed, options={"trial": TRIALS[1].seed})
    for camera in CAMERAS:
        frame = imageio.imread(made / f"videos/observation.images.{camera}/chunk-000/file-001.mp4", index=0)
        # half of the colours are lost in the video; black would be 100 away
        assert np.abs(frame.astype(float) - seen[f"pixels_{camera}"]).mean() < 4.0


def test_statistics_are_those_of_all_frames(made: Path) -> None:
    statistics = read(made / "meta" / "stats.json")["observation.images.scene"]
    episodes = parquet.read_table(made / "meta" / "episodes").to_pylist()
    lengths = [episode["length"] for episode in episodes]
    means = np.array([episode["stats/observation.images.scene/mean"] for episode in episodes])
    assert statistics["count"] == [sum(lengths)]
    assert np.array(statistics["mean"]) == pytest.approx(np.average(means, axis=0, weights=lengths))


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--format", "lerobot"], "need insertions in the format lerobot"),
        (["--format", "minari", "--episode-type", "insertions"], "need insertions in the format lerobot"),
        (["--format", "bop"], "--pixels has no effect on images"),
        (["--format", "lerobot", "--episode-type", "insertions", "--pixels", "side"], "unknown camera 'side'"),
    ],
)
def test_cameras_that_cannot_be_recorded(
    more: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "data"
    assert main(["dataset", "make", "block_on_block", "--pixels", "scene", *more, "--out", str(out)]) == 2
    assert sentence in capsys.readouterr().err
    assert not out.exists()


def test_without_an_encoder_one_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("apo_bench.simulation.scene.render.find_spec", lambda name: None)
    with pytest.raises(InputError, match="an MP4 film needs the package imageio-ffmpeg"):
        make_dataset(TRIALS, tmp_path / "data", "by hand", "lerobot", "straight", pixels=CAMERAS)
    assert not (tmp_path / "data").exists()
