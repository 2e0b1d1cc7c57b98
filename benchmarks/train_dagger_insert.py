"""Train the network of `dagger-insert` by DAgger: `python -m benchmarks.train_dagger_insert draw|train FOLDER`.

    python -m benchmarks.train_dagger_insert draw FOLDER   # a round of episodes under the network of now
    python -m benchmarks.train_dagger_insert train FOLDER  # on all rounds, writes FOLDER/weights.npz; needs PyTorch

Rounds of `draw` and `train` take turns; the network of the first round is all zeros, which is the approach
alone. The teacher is `expert` of `apo_bench.envs.policies`, which knows the true poses; in each episode it takes over
at a drawn step. A round of 24 episodes takes two minutes of one core. The package has such weights in
assets/learned/insert.npz.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections import Counter
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from apo_bench import InputError
from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.dagger_insert import MIRRORS, SHAPES, VECTORS, DaggerInsert
from apo_bench.envs.policies import expert

SCENARIOS = ("stick_in_tower", "dovetail", "shaft_through_brackets")
ERRORS = ("hand_eye:0.25/0.05", "hand_eye:0.5/0.1", "hand_eye:1/0.2")
FIRST = 1_000_000  # the first trial of training: held-out layouts are trials from 0 on
HORIZON = 120
EPOCHS = 60
BATCH = 256
LEARNING_RATE = 1e-3
LAST = len(SHAPES) - 1


def draw(folder: Path, scenario: str, episodes: int) -> None:
    """Save a round of a scenario: what the network reads at each step, and the action of the teacher."""
    file = folder / "weights.npz"
    weights = dict(np.load(file)) if file.exists() else zeros()
    number = len(list(folder.glob(f"{scenario}-*.npz")))
    envs = [make(scenario, error) for error in ERRORS]
    rng = np.random.default_rng([FIRST, number])
    read: list[Any] = []
    taught: list[Any] = []
    ends: list[bool] = []
    for trial in count(FIRST + 10_000 * number):
        if len(ends) == episodes:
            break
        env = envs[trial % len(envs)]
        try:
            observation, info = env.reset(seed=trial, options={"trial": trial})
        except InputError:  # this trial fails before the insertion
            continue
        student = DaggerInsert(weights)
        takes_over = len(read) + int(rng.integers(HORIZON * 3 // 2))
        over = False
        while not over:
            read.append(student.encode(observation))
            taught.append(np.clip(expert(env, observation), -1.0, 1.0))
            action = taught[-1] if len(read) > takes_over else student.act(observation, read[-1])
            observation, _, terminated, truncated, info = env.step(np.asarray(action, np.float32))
            over = terminated or truncated
        ends.append(bool(info["success"]))
    np.savez_compressed(folder / f"{scenario}-{number}.npz", read=np.float32(read), taught=np.float32(taught)[:, :6])
    print(f"{scenario} {number}: {sum(ends)} of {episodes}, {len(read)} steps", flush=True)


def make(scenario: str, robot_error: str) -> APOInsert:
    """Make the environment of a scenario."""
    more: dict[str, Any] = {"robot_error": robot_error, "horizon": HORIZON, "disable_env_checker": True}
    env = gymnasium.make("APOInsert-v0", scenario=scenario, **more).unwrapped
    assert isinstance(env, APOInsert)
    return env


def zeros() -> dict[str, Any]:
    """Return weights of a network whose output is zero."""
    weights = {f"w{i}": np.zeros(shape) for i, shape in enumerate(SHAPES)}
    return weights | {f"b{i}": np.zeros(shape[1]) for i, shape in enumerate(SHAPES)}


def train(folder: Path, seed: int) -> None:
    """Fit the network to the actions of the teacher, with the same weight for all scenarios."""
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    read, taught, chance = (torch.from_numpy(each) for each in load_rounds(folder))
    weights = {}
    for name, each in zeros().items():
        start = torch.zeros(each.shape)
        if each.ndim > 1:
            start = torch.randn(each.shape) * (2.0 / each.shape[0]) ** 0.5
        weights[name] = torch.nn.Parameter(start)
    mirrors = torch.tensor(MIRRORS, dtype=torch.float32)
    optimiser = torch.optim.AdamW(weights.values(), lr=LEARNING_RATE, weight_decay=1e-2)
    steps = EPOCHS * len(read) // BATCH
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for _ in range(steps):
        some = torch.multinomial(chance, BATCH, replacement=True)
        signs = mirrors[torch.randint(len(mirrors), (BATCH,))]
        x = torch.cat([read[some, :VECTORS] * signs.repeat(1, VECTORS // 6), read[some, VECTORS:]], 1)
        for layer in range(LAST):
            x = torch.relu(x @ weights[f"w{layer}"] + weights[f"b{layer}"])
        output = x @ weights[f"w{LAST}"] + weights[f"b{LAST}"]
        loss = ((output - taught[some] * signs) ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    print(f"{len(read)} steps, loss {loss.item():.3f}", flush=True)
    np.savez_compressed(folder / "weights.npz", **{name: each.detach().numpy() for name, each in weights.items()})


def load_rounds(folder: Path) -> tuple[Any, Any, Any]:
    """Return the inputs of the network, the actions of the teacher, and how likely a batch draws each step."""
    rounds = [(file.stem.rpartition("-")[0], np.load(file)) for file in sorted(folder.glob("*-*.npz"))]
    steps: Counter[str] = Counter()
    for scenario, kept in rounds:
        steps[scenario] += len(kept["read"])
    chance = [np.full(len(kept["read"]), 1 / steps[scenario], np.float32) for scenario, kept in rounds]
    read, taught = (np.concatenate([kept[column] for _, kept in rounds]) for column in ("read", "taught"))
    return read, taught, np.concatenate(chance)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("draw", "train"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--episodes", type=int, default=24, help="episodes of a round and scenario (24)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the training (0)")
    given = parser.parse_args(arguments)
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.verb == "train":
        train(given.folder, given.seed)
        return
    for scenario in given.scenarios:
        draw(given.folder, scenario, given.episodes)


if __name__ == "__main__":
    main()
