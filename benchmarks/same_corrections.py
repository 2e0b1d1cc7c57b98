"""Are corrections the same as those of another commit? Goals, statuses and sentences on draws over all scenarios.

    python benchmarks/same_corrections.py FOLDER [--draws 1000] [--plain]

FOLDER is another checkout of this repository, such as `git worktree add ../before COMMIT` makes it. Each of the two
corrects the same draws in a process of its own: all scenarios, four levels of noise, with play and without. The
correctors are `contact`, `contact-drop` and `contact-robust` in turn; with --plain `contact` is not compiled here.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array

LEVELS = ((0.5, 0.25), (2.0, 1.0), (5.0, 3.0), (10.0, 8.0))
"""Noise in mm and degrees."""
METHODS = ("contact", "contact-drop", "contact", "contact-robust")
PLAYS_M = (0.0, 0.25e-3)
ASKED_M = 1e-9


def corrected(draws: int, out: str, plain: bool) -> None:
    """Write the goals and the words of every draw, by the package that this process imports."""
    import apo_bench
    from apo_bench.geometry import pose
    from apo_bench.scenario.file import scenario_names

    every = [apo_bench.load_scenario(name) for name in sorted(scenario_names())]
    goals = dict[str, Array]()
    words = list[str]()
    for draw in range(draws):
        of = every[draw % len(every)]
        mm, degrees = LEVELS[draw // len(every) % len(LEVELS)]
        method = METHODS[draw // (len(every) * len(LEVELS)) % len(METHODS)]
        rng = np.random.default_rng([draw, 11])
        n = len(of.assembly)
        sigma = np.repeat([1e-3 * mm, np.radians(degrees)], 3) * rng.uniform(0.5, 1.5, size=(n, 1))
        L = sigma[:, :, None] * (np.tril(rng.normal(scale=0.2, size=(n, 6, 6)), -1) + np.eye(6))
        seen = of.goals @ pose.exp((L @ rng.standard_normal((n, 6, 1)))[..., 0])
        observation = apo_bench.Observation(
            assembly=of.assembly,
            start=of.start,
            goals=seen,
            covariance=L @ np.swapaxes(L, 1, 2),
            seen=np.ones(n, dtype=np.bool_),
            play_m=PLAYS_M[draw % len(PLAYS_M)],
        )
        chosen = apo_bench.ContactCorrector(compiled=False) if plain and method == "contact" else method
        made = apo_bench.correct(observation, chosen)
        goals[f"goals{draw}"] = made.goals
        goals[f"covariance{draw}"] = np.zeros(0) if made.covariance is None else made.covariance
        words.append(f"{of.name} {mm} {method}|{made.status}|{made.rank}|{made.sentence}")
    np.savez(out, words=np.array(words), **goals)


def main() -> None:
    """Say how far goals are apart, and where words differ."""
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    given.add_argument("folder", help="another checkout")
    given.add_argument("--draws", type=int, default=1000)
    given.add_argument("--plain", action="store_true", help="`contact` is not compiled here")
    given.add_argument("--out", help="write corrections to this file, and compare nothing")
    asked = given.parse_args()
    if asked.out:
        corrected(asked.draws, asked.out, asked.plain)
        return
    here = Path(__file__).resolve().parents[1]
    there = Path(asked.folder).resolve()
    with tempfile.TemporaryDirectory() as folder:
        for name, package in (("before", there), ("now", here)):
            command = [sys.executable, __file__, "-", "--draws", str(asked.draws), "--out", f"{folder}/{name}.npz"]
            command += ["--plain"] if asked.plain and name == "now" else []
            environment = os.environ | {"PYTHONPATH": str(package), "NUMBA_CACHE_DIR": f"{folder}/{name}"}
            subprocess.run(command, check=True, env=environment, cwd=package)
        compare(f"{folder}/before.npz", f"{folder}/now.npz")


def compare(before: str, now: str) -> None:
    """Print what differs."""
    with np.load(before) as old, np.load(now) as new:
        pairs = list(zip(old["words"].tolist(), new["words"].tolist(), strict=True))
        off_m = np.array([np.abs(old[f"goals{i}"] - new[f"goals{i}"]).max(initial=0.0) for i in range(len(pairs))])
        shapes = [(old[f"covariance{i}"], new[f"covariance{i}"]) for i in range(len(pairs))]
        wide = [float(np.abs(a - b).max(initial=0.0)) if a.shape == b.shape else np.inf for a, b in shapes]
    for i, (a, b) in enumerate(pairs):
        if a.split("|")[1:3] != b.split("|")[1:3] or off_m[i] > ASKED_M:
            print(f"draw {i}, goals {off_m[i]:.2g} m apart\n  before: {a}\n  now:    {b}")
    status = sum(a.split("|")[1] != b.split("|")[1] for a, b in pairs)
    sentence = sum(a != b for a, b in pairs)
    converged = np.array(["|converged|" in a for a, _ in pairs])
    print(
        f"{len(pairs)} draws: {int((off_m > ASKED_M).sum())} with goals more than {ASKED_M:g} m apart, the farthest "
        f"{off_m.max():.2g} m, of {int(converged.sum())} converged ones {off_m[converged].max(initial=0.0):.2g} m; "
        f"another status {status}, another sentence or rank {sentence}; covariances at most {max(wide):.2g} apart"
    )


if __name__ == "__main__":
    main()
