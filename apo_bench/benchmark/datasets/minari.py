"""Write episodes as a Minari data set.

The format is that of `Farama-Foundation/Minari`, `minari/dataset/_storages/hdf5_storage.py`: one group per episode,
with the observation before the first action and after each, and a file with the spaces and the metadata.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench import __version__
from apo_bench.benchmark.datasets.card import DatasetMetadata, Field, RecordedEpisode, count_outcomes, write_card
from apo_bench.errors import missing_package
from apo_bench.io import replace_file, write_file

_OWN = {  # column -> its meaning
    "rewards": "reward of each action",
    "terminations": "whether the episode is over after the action",
    "truncations": "whether time runs out with the action",
    "infos/success": "whether it is over and right, by the judge, before the first action and after each",
}
_OF_EPISODE = {  # attribute of an episode -> its meaning
    "id": "from 0",
    "seed": "number of the trial",
    "total_steps": "how many actions",
    **{f"rewards_{name}": f"{name} of all rewards" for name in ("max", "min", "mean", "std", "sum")},
}


def load_h5py() -> Any:
    """Import h5py.

    Raises:
        InputError: The package is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise missing_package("the format minari", "h5py") from error
    return h5py


def write_minari(rollouts: Iterable[RecordedEpisode], about: DatasetMetadata, out: Path) -> tuple[int, int]:
    """Write episodes, and the card.

    Returns:
        The number of episodes, and the number of successes.

    Raises:
        InputError: The package h5py is not installed.
        OSError: A file cannot be written.
    """
    h5py = load_h5py()
    folder = out / "data"
    folder.mkdir(parents=True)
    steps = 0
    ends: list[Mapping[str, Any]] = []
    with replace_file(folder / "main_data.hdf5") as file, h5py.File(file, "w", track_order=True) as data:
        for rollout in rollouts:
            _write_episode(data.create_group(f"episode_{len(ends)}"), rollout, len(ends))
            ends.append(rollout.more)
            steps += len(rollout.actions)
    metadata = {
        "dataset_id": f"apo_bench/{about.name}-v0",
        "total_episodes": len(ends),
        "total_steps": steps,
        "dataset_size": round((folder / "main_data.hdf5").stat().st_size / 1e6, 1),
        "data_format": "hdf5",
        "jpeg_encoding": False,
        "observation_space": json.dumps(
            {"type": "Dict", "subspaces": {n: _make_box_space(f) for n, f in about.fields.items()}}
        ),
        "action_space": json.dumps(_make_box_space(about.action)),
        "minari_version": "0.5.4",  # whose format this is
        "algorithm_name": about.command,
        "author": ["The apo_bench authors"],
        "description": about.summary,
        "requirements": [f"apo_bench=={__version__}"],
        **({"env_spec": about.env_spec} if about.env_spec else {}),
    }
    write_file(folder / "metadata.json", json.dumps(metadata, indent=1))
    observations = {f"observations/{name}": field for name, field in about.fields.items()}
    robot = {f"infos/{name}": field for name, field in about.robot_fields.items()}
    where = "data/main_data.hdf5"
    tables: dict[str, dict[str, Any]] = {
        f"{where}: groups episode_0, ..": {**observations, "actions": about.action, **_OWN, **robot},
        f"{where}: attributes of each": {**_OF_EPISODE, **about.episodes},
    }
    outcomes = count_outcomes(ends)
    write_card(about, out, outcomes, tables)
    return outcomes.total(), outcomes["ok"]


def _write_episode(group: Any, rollout: RecordedEpisode, episode: int) -> None:
    """Write one episode into its HDF5 group."""
    rewards = np.asarray(rollout.rewards, dtype=np.float64)
    of_rewards = {f"rewards_{name}": getattr(rewards, name)() for name in ("max", "min", "mean", "std", "sum")}
    told = {name: _to_hdf5_type(x) for name, x in rollout.more.items() if x is not None}
    group.attrs.update({**told, "id": episode, "seed": rollout.seed, "total_steps": len(rewards), **of_rewards})
    for name, numbers in rollout.observations.items():
        group.create_dataset(f"observations/{name}", data=numbers.astype(np.float32))
    group.create_dataset("actions", data=rollout.actions.astype(np.float32))
    group.create_dataset("rewards", data=rewards)
    over = np.arange(len(rewards) + 1) == len(rewards)  # one entry more than actions: also before the first action
    group.create_dataset("terminations", data=over[1:] & (not rollout.truncated))
    group.create_dataset("infos/success", data=over & bool(rollout.more["success"]))
    group.create_dataset("truncations", data=over[1:] & rollout.truncated)
    for name, numbers in rollout.robot.items():
        group.create_dataset(f"infos/{name}", data=numbers.astype(np.float32))


def _to_hdf5_type(x: Any) -> Any:
    """Convert a list of texts to a type that HDF5 takes; other values stay."""
    return np.array(x, dtype=object) if isinstance(x, list) and x and isinstance(x[0], str) else x


def _make_box_space(field: Field) -> dict[str, Any]:
    """Return a field as a `Box` space, in Minari's spelling."""
    high = np.broadcast_to(np.array(field.most, dtype=np.float32), len(field.names))
    shape = [len(field.names)]
    return {"type": "Box", "dtype": "float32", "shape": shape, "low": (-high).tolist(), "high": high.tolist()}
