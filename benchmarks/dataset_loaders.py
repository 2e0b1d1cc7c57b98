"""Read data sets of `apo-bench dataset make` with other loaders: `python benchmarks/dataset_loaders.py`.

The script writes replays and insertions in every format, and reads them in virtual environments: with LeRobot
(`--python312`, as it needs Python 3.12; 5 GB of PyTorch), and Minari. Each result is compared with that of
PyArrow or h5py. LeRobot also trains a small policy and evaluates it, as in the guide. `--envs FOLDER` keeps the virtual
environments. Needs h5py: `pip install apo_bench[data]`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MADE = {
    "replays": ("block_on_block", "dovetail", "--episodes", "2", "--noise-level", "2", "--method", "contact"),
    "insertions": ("block_on_block", "--episodes", "2", "--episode-type", "insertions"),
}
IMAGES = ("--pixels", "scene", "--pixels", "wrist")  # of insertions for LeRobot
NEEDS = {
    "lerobot": ("lerobot[dataset,training]", str(ROOT)),
    "minari": ("minari[hdf5]", "pillow"),
}
LEROBOT = """
import sys
from importlib.metadata import version
from pathlib import Path
import numpy as np, torch
from pyarrow import parquet
from lerobot.datasets.lerobot_dataset import LeRobotDataset
root = Path(sys.argv[1])
data = LeRobotDataset("apo_bench/data", root=root)
table = parquet.read_table(root / "data")
assert len(data) == table.num_rows
frames = [data[i] for i in range(len(data))]
for name in table.column_names:
    here = np.array(table[name].to_pylist())
    read = np.stack([np.asarray(frame[name]) for frame in frames])
    assert np.array_equal(here.reshape(read.shape).astype(read.dtype), read), name
for name in data.meta.video_keys:
    read = np.stack([np.asarray(frame[name]) for frame in frames])
    assert read.shape == (len(data), *data.meta.shapes[name][-1:], *data.meta.shapes[name][:2]), name
    mean = np.asarray(data.meta.stats[name]["mean"])
    assert np.abs(read.mean(axis=(0, 2, 3)) - mean.ravel()).max() < 0.01, name  # compression changes colours a little
assert set(data.meta.stats) == {*table.column_names, *data.meta.video_keys}
assert {"q01", "q99"} <= set(data.meta.stats["action"])
assert data.meta.tasks.iloc[0].name == data[0]["task"]
times = {"observation.state": [-0.1, 0.0], "action": [0.0, 0.05]}
first = LeRobotDataset("apo_bench/data", root=root, episodes=[1], delta_timestamps=times)[0]
assert first["observation.state"].shape[0] == 2 and first["observation.state_is_pad"].tolist() == [True, False]
right = LeRobotDataset("apo_bench/data", root=root, episode_filter=lambda episode: episode["success"])
batch = next(iter(torch.utils.data.DataLoader(data, batch_size=8, shuffle=True)))
print(f"LeRobot {version('lerobot')}: {data.num_episodes} episodes, {len(data)} frames, {right.num_episodes} right,",
      f"batches of {tuple(batch['action'].shape)} actions, images {data.meta.video_keys}")
"""
MINARI = """
import json, os, sys
from importlib.metadata import version
from pathlib import Path
import h5py, numpy as np, minari
root = Path(sys.argv[1])
name = json.loads((root / "data" / "metadata.json").read_text())["dataset_id"]
os.environ["MINARI_DATASETS_PATH"] = str(root.parent / "minari-root")
link = root.parent / "minari-root" / name
link.parent.mkdir(parents=True, exist_ok=True)
link.symlink_to(root)
data = minari.load_dataset(name)
file = h5py.File(root / "data" / "main_data.hdf5")
steps = 0
for e, episode in enumerate(data):
    here = file[f"episode_{e}"]
    assert np.array_equal(episode.actions, here["actions"]) and "EpisodeData" in repr(episode)
    for key, seen in episode.observations.items():
        assert np.array_equal(seen, here["observations"][key])
    for k in range(len(episode) + 1):
        assert data.observation_space.contains({key: seen[k] for key, seen in episode.observations.items()})
    assert all(data.action_space.contains(action) for action in episode.actions)
    steps += len(episode)
assert steps == data.total_steps and len(data.sample_episodes(2)) == 2
right = data.filter_episodes(lambda episode: bool(episode.infos["success"][-1]))
print(f"Minari {version('minari')}: {data.total_episodes} episodes, {steps} steps, {right.total_episodes} right, of",
      data.env_spec.id if data.env_spec else "no environment")
"""


def environment(folder: Path, python: str, needs: tuple[str, ...]) -> Path:
    """Return the Python of a virtual environment with these packages; make it if it is missing."""
    made = folder / "bin" / "python"
    if not made.exists():
        subprocess.run([python, "-m", "venv", str(folder)], check=True)
        subprocess.run([made, "-m", "pip", "--quiet", "install", "--upgrade", "pip"], check=True)
        subprocess.run([made, "-m", "pip", "--quiet", "install", *needs], check=True)
    return made


def trains(python: Path, data: Path, steps: int) -> None:
    """Some steps of a small policy of images, and two episodes of it, by LeRobot's commands and the guide's files."""
    here = data.parent / "trained"
    guide = (ROOT / "docs" / "guide" / "lerobot.md").read_text(encoding="utf-8")
    for name, text in re.findall(r'^```py(?:thon)? title="([^"]+)"\n(.*?)^```$', guide, re.M | re.S):
        (here / name).parent.mkdir(parents=True, exist_ok=True)
        (here / name).write_text(text.replace("CAMERAS = ()", 'CAMERAS = ("scene", "wrist")'), encoding="utf-8")
    small = "--policy.type=act --policy.dim_model=64 --policy.n_heads=2 --policy.push_to_hub=false"
    small += " --policy.pretrained_backbone_weights=null"  # they would be downloaded
    how = f"--steps={steps} --save_freq={steps} --batch_size=8 --num_workers=0 --policy.device=cpu --output_dir=act"
    taken = "--policy.path=act/checkpoints/last/pretrained_model --policy.device=cpu --env.type=apo_insert"
    tried = "--env.discover_packages_path=apo_lerobot --eval.n_episodes=2 --eval.batch_size=2 --output_dir=tried"
    for command, words in (
        ("lerobot-train", f"{small} {how} --dataset.repo_id=me/inserted --dataset.root={data}"),
        ("lerobot-eval", f"{taken} {tried}"),
    ):
        alone = os.environ | {"PYTHONPATH": str(here), "HF_HUB_OFFLINE": "1", "HF_HOME": str(data.parent / "hub")}
        command_line = [python.with_name(command), *words.split()]
        done = subprocess.run(command_line, env=alone, cwd=here, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{command} failed:\n{done.stderr[-2000:]}")
    overall = json.loads((here / "tried" / "eval_info.json").read_text(encoding="utf-8"))["overall"]
    print(f"  trained and evaluated: {overall['n_episodes']} episodes, {overall['pc_success']:.0f} % right", flush=True)


def reads(python: Path, program: str, folder: Path) -> None:
    """Print the output of a loader; end this program if it fails."""
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    alone |= {"HF_HUB_OFFLINE": "1", "HF_HOME": str(folder.parent / "hub")}
    done = subprocess.run([python, "-c", program, str(folder)], env=alone, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{folder.name} was not read:\n{done.stderr[-2000:]}")
    print(f"  {done.stdout.strip()}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=Path, help="a folder where environments are kept")
    parser.add_argument("--steps", type=int, default=5, help="training steps of LeRobot's policy")
    parser.add_argument("--python312", default="python3.12", help="Python 3.12 or later, for LeRobot")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        here = Path(scratch)
        envs = (given.envs or here).resolve()
        others = environment(envs / "minari", sys.executable, NEEDS["minari"])
        lerobot = environment(envs / "lerobot", given.python312, NEEDS["lerobot"])
        for what, words in MADE.items():
            for form in ("parquet", "lerobot", "minari"):
                if (form, what) == ("parquet", "insertions"):
                    continue
                out = here / f"{what}-{form}"
                more = IMAGES if (form, what) == ("lerobot", "insertions") else ()
                made = *words, *more, "--format", form, "--out", out
                make = (sys.executable, "-m", "apo_bench", "dataset", "make", *made)
                subprocess.run(make, check=True, stdout=subprocess.DEVNULL)
                print(f"{what}, {form}:", flush=True)
                if form == "lerobot":
                    reads(lerobot, LEROBOT, out)
                    if what == "insertions":
                        trains(lerobot, out, given.steps)
                if form == "minari":
                    reads(others, MINARI, out)


if __name__ == "__main__":
    main()
