"""Measure `recording import` on made recordings: `python -m benchmarks.recordings [--seeds 10] [--only DISTURBANCE]`.

Every part of every scenario moves along straight lines and is tracked by a camera whose pose is stated. Errors are
Gaussian: one of each frame, and one that is constant during a rest, both 0.5 mm and 0.5 degrees (1 sigma per axis). A
rest is right if all six components of its error are within three stated standard deviations. It is wrong beyond six,
and silently wrong if the importer states no doubt. Writes `results/recordings.csv` and prints a table.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench import InputError, Scenario, load_scenario
from apo_bench.geometry import Array, Solid, find_nearest_equivalent_pose, pose
from apo_bench.importers.recording.camera_file import CameraFile, Conventions
from apo_bench.importers.recording.folding import are_alike, free_twist, list_images
from apo_bench.importers.recording.importing import import_recording
from apo_bench.importers.recording.matching import match_tracks
from apo_bench.importers.recording.objects_file import ObjectsFile, TrackedPart
from apo_bench.importers.recording.ordering import Stated
from apo_bench.importers.recording.tracks import LogRows, sort_rows
from apo_bench.scenario import list_scenario_names, place_layout
from benchmarks.rates_by_condition import table
from tests.recorded import CAMERA, motion

RESULTS = Path(__file__).parent / "results" / "recordings.csv"
SCENARIOS = list_scenario_names()
FRAME = 0.5 * np.repeat([1e-3, np.radians(1.0)], 3)  # standard deviations of each frame, and of each rest
TURNS = 24  # images of a part of revolution
HIDDEN_S = 3.0
RIGHT = 3.0  # standard deviations
WRONG = 6.0


class Disturbance(NamedTuple):
    """The faults of a tracker."""

    flips: float = 0.0
    """Share of frames at another image under the symmetry of the part."""
    lost: float = 0.0
    """Share of lost frames."""
    hides: bool = False
    """Whether one part has no frames for `HIDDEN_S`."""
    swaps: bool = False
    """Whether two identical parts swap their ids for good."""


DISTURBANCES: Mapping[str, Disturbance] = {
    "none": Disturbance(),
    "10 % flips": Disturbance(flips=0.1),
    "30 % flips": Disturbance(flips=0.3),
    "50 % flips": Disturbance(flips=0.5),
    "20 % lost": Disturbance(lost=0.2),
    "hidden for 3 s": Disturbance(hides=True),
    "ids swapped": Disturbance(swaps=True),
    "30 % flips, 20 % lost, hidden for 3 s": Disturbance(0.3, 0.2, True),
}


class Result(NamedTuple):
    """The import of one recording."""

    disturbance: str
    scenario: str
    seed: int
    operations: int
    observed: int
    """Rests that were observed."""
    right: int
    wrong: int
    silent: int
    """Rests that are wrong in a recording without doubts."""
    chi: float
    """Sum of squared errors in stated standard deviations."""
    freedom: int
    """Degrees of freedom of this sum."""
    refused: str
    """The error; empty for an imported recording."""


class Parts(NamedTuple):
    """Tracks of parts with their symmetric images."""

    t: Array
    T: dict[str, Array]
    seen: dict[str, Array]
    """Part -> frames that the log shows, (n,)."""


def make_tracks(scenario: Scenario, how: Disturbance, rng: np.random.Generator) -> Parts:
    """Return the tracks of a disturbed recording, camera from part."""
    t, moved = motion(scenario.name)
    solids = scenario.assembly.solids
    start = place_layout(scenario, 0.1, 0.0, 0.3, clearance_mm=scenario.clearance_mm).start
    still = {part: np.repeat(start[part][None], len(t), axis=0) for part in sorted(scenario.assembly.fixed)}
    T = {part: pose.inverse(CAMERA) @ add_errors(world, rng) for part, world in {**still, **moved}.items()}
    T = {part: flip(solids[part], track, how.flips, rng) for part, track in T.items()}
    seen = {part: rng.random(len(t)) >= how.lost for part in T}
    if how.hides:
        begins = rng.uniform(0.0, max(t[-1] - HIDDEN_S, 0.0))
        seen[str(rng.choice([*moved]))] &= (t < begins) | (t > begins + HIDDEN_S)
    if how.swaps:
        alike = [pair for pair in combinations(moved, 2) if are_alike(*(solids[part] for part in pair))]
        a, b = alike[rng.integers(len(alike))]
        later = t > rng.uniform(0.5, t[-1] - 0.5)
        T[a], T[b] = (np.where(later[:, None, None], T[y], T[x]) for x, y in ((a, b), (b, a)))
    return Parts(t, T, seen)


def add_errors(T: Array, rng: np.random.Generator) -> Array:
    """Return poses with an error of each frame and one that changes with each motion."""
    moves = np.concatenate([[False], np.abs(np.diff(T, axis=0)).max(axis=(1, 2)) > 0.0])
    rest = np.cumsum(moves)  # frames of a rest share a number, and frames in motion have one each
    constant = rng.standard_normal((rest[-1] + 1, 6))[rest]
    return np.asarray(T @ pose.exp(FRAME * constant) @ pose.exp(FRAME * rng.standard_normal((len(T), 6))))


def flip(solid: Solid, T: Array, share: float, rng: np.random.Generator) -> Array:
    """Return poses of which a share are at other images."""
    images = list_images(solid, np.eye(4), TURNS)
    drawn = rng.integers(1, len(images), len(T)) if len(images) > 1 else np.zeros(len(T), dtype=np.int64)
    return np.asarray(T @ images[np.where(rng.random(len(T)) < share, drawn, 0)])


def measure(name: str, disturbance: str, seed: int) -> Result:
    """Return how well one recording is imported."""
    scenario = load_scenario(name)
    assembly = scenario.assembly
    rng = np.random.default_rng([seed, SCENARIOS.index(name)])
    t, T, seen = make_tracks(scenario, DISTURBANCES[disturbance], rng)
    rows = sorted((t[i], part, i) for part in T for i in np.flatnonzero(seen[part]))
    ids = [part for _, part, _ in rows]
    n = len(rows)
    log = sort_rows(
        "log",
        LogRows(
            ids,
            np.array([row[0] for row in rows]),
            np.array([T[part][i] for _, part, i in rows]),
            np.zeros(n, dtype=np.bool_),
            np.zeros(n),
            ["log"] * n,
            [],
        ),
    )
    objects = ObjectsFile("objects", {part: TrackedPart((part,), np.eye(4), {}) for part in T}, frozenset())
    camera = CameraFile(Conventions(), CAMERA, {}, FRAME[[0, 3]])
    counts = (disturbance, name, seed, len(assembly))
    try:
        matched = match_tracks(log, objects, assembly.solids)
        found = import_recording(matched.tracks, camera, scenario, Stated(), "log", None, matched.identical)
    except InputError as error:
        return Result(*counts, 0, 0, 0, 0, 0.0, 0, str(error))
    goals = place_layout(scenario, 0.1, 0.0, 0.3, clearance_mm=scenario.clearance_mm).poses
    observation = found.observation
    right = wrong = freedom = 0
    chi = 0.0
    for k in np.flatnonzero(observation.observed):
        solid = assembly.solids[assembly.operations[k].main]
        T_found = find_nearest_equivalent_pose(solid, observation.poses[k], goals[k])
        xi = pose.log(pose.inverse(goals[k]) @ T_found)
        W = np.linalg.inv(observation.covariance[k])
        free = free_twist(solid)
        if free is not None:  # no weight along the turn that is not observed
            W -= np.outer(W @ free, W @ free) / (free @ W @ free)
        worst = float(np.abs(xi / np.sqrt(np.diag(observation.covariance[k]))).max())
        right += worst <= RIGHT
        wrong += worst > WRONG
        chi += min(float(xi @ W @ xi), 100.0)  # a wrong rest is counted as such
        freedom += 6 - (free is not None)
    observed = int(observation.observed.sum())
    return Result(*counts, observed, right, wrong, 0 if found.doubts else wrong, chi, freedom, "")


def measure_all(seeds: int, disturbances: Sequence[str], scenarios: Sequence[str]) -> Iterator[Result]:
    """Yield the results of all recordings; ids are swapped where two parts are identical."""
    for disturbance in disturbances:
        for name in scenarios:
            solids = load_scenario(name).assembly.solids
            moved = [solids[part] for part in motion(name)[1]]
            if not DISTURBANCES[disturbance].swaps or any(are_alike(a, b) for a, b in combinations(moved, 2)):
                yield from (measure(name, disturbance, seed) for seed in range(seeds))


def summarise(results: Sequence[Result]) -> str:
    """Return a table with a row for each disturbance."""
    rows = []
    for disturbance, group in groupby(results, key=lambda each: each.disturbance):
        own = [*group]
        kept = [each for each in own if not each.refused]
        observed = sum(each.observed for each in kept)
        rows.append(
            (
                disturbance,
                f"{len(own)}",
                f"{100.0 * (1.0 - len(kept) / len(own)):.1f}",
                f"{sum(each.operations for each in kept) - observed}",
                f"{100.0 * sum(each.right for each in kept) / max(observed, 1):.1f}",
                f"{sum(each.wrong for each in kept)}",
                f"{sum(each.silent for each in kept)}",
                f"{sum(each.chi for each in kept) / max(sum(each.freedom for each in kept), 1):.2f}",
            )
        )
    head = ("disturbance", "recordings", "refused %", "rests unseen", "right %", "wrong", "silent", "chi-square")
    return "\n".join(table(head, rows))


def main() -> None:
    """Measure and write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", nargs="+", choices=DISTURBANCES, default=[*DISTURBANCES])
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=SCENARIOS)
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    results = [*measure_all(given.seeds, given.only, given.scenarios)]
    with given.out.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows([Result._fields, *results])
    print(summarise(results))


if __name__ == "__main__":
    main()
