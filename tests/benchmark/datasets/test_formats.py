"""Data sets in the formats of others, laid out by their rules; `benchmarks/dataset_loaders.py` asks their loaders."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from pyarrow import parquet

from apo_bench import InputError, TrialConfig
from apo_bench.benchmark.datasets.trial_dataset import make_dataset

REPLAYED = [
    TrialConfig(name, method="contact", seed=1000000, clearance_mm=0.5) for name in ("block_on_block", "dovetail")
]
INSERTED = [TrialConfig("block_on_block", method="contact", seed=1000000 + k) for k in range(2)]


@pytest.fixture(scope="module")
def lerobot(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Replays and insertions in LeRobot's format."""
    made = {name: tmp_path_factory.mktemp("lerobot") / name for name in ("replays", "insertions")}
    assert make_dataset(REPLAYED, made["replays"], "by hand", "lerobot") == (2, 2)
    assert make_dataset(INSERTED, made["insertions"], "by hand", "lerobot", "straight")[0] == 2
    return made


@pytest.fixture(scope="module")
def minari(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same in Minari's."""
    pytest.importorskip("h5py")
    made = {name: tmp_path_factory.mktemp("minari") / name for name in ("replays", "insertions")}
    make_dataset(REPLAYED, made["replays"], "by hand", "minari")
    make_dataset(INSERTED, made["insertions"], "by hand", "minari", "straight")
    return made


def columns(table: Any) -> dict[str, np.ndarray]:
    return {name: np.array(table[name].to_pylist()) for name in table.column_names}


@pytest.mark.parametrize("what", ["replays", "insertions"])
def test_lerobot_finds_every_frame_where_its_table_of_episodes_says(lerobot: dict[str, Path], what: str) -> None:
    root = lerobot[what]
    info = json.loads((root / "meta" / "info.json").read_text())
    frames = columns(parquet.read_table(root / info["data_path"].format(chunk_index=0, file_index=0)))
    episodes = parquet.read_table(root / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert (info["codebase_version"], info["fps"], info["splits"]) == ("v3.0", 20, {"train": "0:2"})
    assert (info["total_episodes"], info["total_frames"]) == (2, len(frames["index"]))
    assert frames.keys() == info["features"].keys()
    for name, feature in info["features"].items():
        assert frames[name].shape[1:] == (() if feature["shape"] == [1] else tuple(feature["shape"]))
        assert feature["names"] is None or len(feature["names"]) == feature["shape"][0]
    np.testing.assert_array_equal(frames["index"], np.arange(info["total_frames"]))
    for e, episode in enumerate(episodes):
        here = slice(episode["dataset_from_index"], episode["dataset_to_index"])
        n = episode["length"]
        assert set(frames["episode_index"][here]) == {episode["episode_index"]} == {e}
        assert set(frames["seed"][here]) == {episode.get("seed", 1000000 + e)}
        np.testing.assert_allclose(frames["timestamp"][here], np.arange(n) / 20, atol=1e-6)
        np.testing.assert_array_equal(frames["next.done"][here], np.arange(n) == n - 1)
        assert frames["next.success"][here].sum() == episode["success"] == frames["next.reward"][here].sum()
        for name in ("action", "observation.wrench"):
            x = frames[name][here]
            np.testing.assert_allclose(episode[f"stats/{name}/mean"], x.mean(axis=0), rtol=1e-4, atol=1e-6)
            np.testing.assert_allclose(episode[f"stats/{name}/q99"], np.quantile(x, 0.99, axis=0), rtol=1e-5, atol=1e-6)
    assert parquet.ParquetFile(root / "data" / "chunk-000" / "file-000.parquet").num_row_groups == 2


def test_minari_finds_what_was_seen_around_every_action(minari: dict[str, Path], lerobot: dict[str, Path]) -> None:
    h5py = pytest.importorskip("h5py")
    for what, root in minari.items():
        told = json.loads((root / "data" / "metadata.json").read_text())
        space = json.loads(told["observation_space"])["subspaces"]
        assert (told["data_format"], told["jpeg_encoding"]) == ("hdf5", False)
        frames = columns(parquet.read_table(lerobot[what] / "data"))
        with h5py.File(root / "data" / "main_data.hdf5") as file:
            assert told["total_episodes"] == len(file) == 2
            assert told["total_steps"] == sum(each.attrs["total_steps"] for each in file.values())
            for e in range(2):
                episode = file[f"episode_{e}"]
                n = len(episode["actions"])
                assert (episode.attrs["id"], episode.attrs["total_steps"]) == (e, n)
                assert episode["observations"].keys() == space.keys()
                here = frames["episode_index"] == e
                assert set(frames["seed"][here]) == {episode.attrs["seed"]}
                np.testing.assert_array_equal(episode["actions"][()], frames["action"][here])
                for name, box in space.items():
                    seen = episode["observations"][name][()]
                    assert seen.shape == (n + 1, *box["shape"])
                    assert str(seen.dtype) == box["dtype"]
                    assert (np.abs(seen) <= box["high"]).all()
                    called = f"observation.{name}".replace("agent_pos", "state")
                    np.testing.assert_array_equal(seen[:-1].squeeze(), frames[called][here])
                assert [len(episode[name]) for name in ("rewards", "terminations", "truncations")] == [n] * 3
                assert episode["terminations"][()].sum() == episode["terminations"][-1] == 1
                assert episode["infos/success"][-1] == episode.attrs["success"]
    spec = EnvSpec.from_json(told["env_spec"])
    assert (spec.id, spec.kwargs["scenario"]) == ("APOInsert-v0", "block_on_block")


def test_frames_of_insertions_have_joints_tip_command_and_phase(
    minari: dict[str, Path], lerobot: dict[str, Path]
) -> None:
    h5py = pytest.importorskip("h5py")
    frames = columns(parquet.read_table(lerobot["insertions"] / "data"))
    first = frames["episode_index"] == 0
    for name in ("tip", "tip_command"):
        np.testing.assert_allclose(np.linalg.norm(frames[f"robot.{name}"][:, 3:], axis=1), 1.0, atol=1e-6)
    assert frames["robot.joints"].shape[1] == 7  # six joints, and the opening
    apart = np.linalg.norm(frames["robot.tip"][:, :3] - frames["robot.tip_command"][:, :3], axis=1)
    assert apart.max() < 0.005
    phases = frames["robot.phase"][first]
    assert phases[0] == 0.0
    assert (np.diff(phases) >= 0.0).all()
    with h5py.File(minari["insertions"] / "data" / "main_data.hdf5") as file:
        infos = file["episode_0/infos"]
        np.testing.assert_array_equal(infos["tip_command"][:-1], frames["robot.tip_command"][first])
        assert infos["phase"][-1] == 4.0


def test_the_card_of_insertions_states_every_argument_the_split_and_the_citation(lerobot: dict[str, Path]) -> None:
    card = (lerobot["insertions"] / "README.md").read_text()
    for line in (
        "| `shift_mm` | `1.0` |",
        "| `turn_deg` | `0.5` |",
        "| `horizon` | `400` |",
        "| `corrector` | `'contact'` |",
    ):
        assert line in card
    assert "the split `train`" in card
    assert "@software{apo_bench," in card


@pytest.mark.parametrize(
    ("form", "policy", "pixels"), [("lerobot", "expert", ()), ("lerobot", "expert", ("wrist",)), ("minari", None, ())]
)
def test_every_episode_is_the_same_bit_for_bit_when_it_is_made_again(
    form: str, policy: str | None, pixels: tuple[str, ...], tmp_path: Path
) -> None:
    if form == "minari":
        pytest.importorskip("h5py")
    if pixels:
        pytest.importorskip("imageio_ffmpeg")
    for name in "ab":
        make_dataset(INSERTED[:1], tmp_path / name, "by hand", form, policy, pixels=pixels)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*.*") if path.is_file())
    assert len(files) >= 3
    for path in files:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes(), path


def test_without_pyarrow_one_sentence_says_what_to_install_before_any_trial(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr(
        "apo_bench.benchmark.datasets.trial_dataset.scene_of", lambda *_: pytest.fail("a scene was built")
    )
    words = r"^the format lerobot needs the package pyarrow; install it with: pip install"
    with pytest.raises(InputError, match=words):
        make_dataset(REPLAYED[:1], tmp_path / "data", "by hand", "lerobot")
    assert not (tmp_path / "data").exists()
