"""Measure how well the depth camera locates parts: `python benchmarks/depth_camera.py [--trials 30]`.

Each demonstration is simulated and recorded once per seed; every noise level senses the same images. No robot moves.
Prints a table: how many operations were located, errors of position and rotation (median, 90 %, largest), and the mean
chi-square of an error over its six degrees of freedom, which is 1 where the stated covariance is right.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import pose
from apo_bench.scenario.scenario_file import list_scenario_names, load_scenario
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.trial_stages import (
    OBSERVATION,
    SimulatedDemonstration,
    range_sensor,
    simulate_demonstration,
    stream,
)


class Located(NamedTuple):
    """The error of one located part."""

    mm: float
    deg: float
    chi_square: float


def locate(scene: Scene, shown: SimulatedDemonstration, noise_level: float, seed: int) -> Iterator[Located | None]:
    """Yield the error of every operation; None where the camera did not locate the part."""
    camera = range_sensor(scene, shown, noise_level)
    events = camera.detect_operations(shown.demonstration, camera.add_noise(stream(seed, OBSERVATION)))
    found = {event.operation: event.found for event in events}
    for k, T in enumerate(shown.demonstration.poses):
        part = found.get(k)
        if part is None:
            yield None
            continue
        xi = pose.log(pose.inverse(part.T) @ T)
        chi_square = float(xi @ np.linalg.solve(part.covariance, xi))
        yield Located(1e3 * float(np.linalg.norm(xi[:3])), float(np.degrees(np.linalg.norm(xi[3:]))), chi_square)


def line(name: str, noise_level: float, errors: Sequence[Located | None], seconds: float) -> str:
    """Return a line of the table."""
    found = np.array([error for error in errors if error is not None])
    quantiles = np.quantile(found[:, :2], [0.5, 0.9, 1.0], axis=0).T
    mm, deg = (" ".join(f"{x:.2f}" for x in row) for row in quantiles)
    ratio = found[:, 2].mean() / 6
    return f"| {name} | {noise_level:g} | {len(found)} of {len(errors)} | {mm} | {deg} | {ratio:.2f} | {seconds:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--noise-level", type=float, nargs="+", default=[1.0])
    parser.add_argument("--scenarios", nargs="+", default=list(list_scenario_names()))
    parser.add_argument("--human-error-scale", type=float, default=1.0)
    given = parser.parse_args()
    print("| scenario | noise level | located | mm | deg | chi-square / 6 | seconds |\n" + "|---" * 7 + "|")
    for name in given.scenarios:
        scene = build_scene(load_scenario(name))
        errors: dict[float, list[Located | None]] = {level: [] for level in given.noise_level}
        seconds = 0.0
        for seed in range(given.trials):
            shown = simulate_demonstration(scene, given.human_error_scale, seed, "depth-camera")
            begun = time.process_time()
            if shown.demonstration.code == "ok":
                for level, own in errors.items():
                    own += locate(scene, shown, level, seed)
            seconds += (time.process_time() - begun) / len(errors)
        for level, own in errors.items():
            print(line(name, level, own, seconds / given.trials), flush=True)


if __name__ == "__main__":
    main()
