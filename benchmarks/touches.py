"""Do touches tell of a robot what they say they tell? `python benchmarks/touches.py [--draws N] [--out FILE.csv]`
(a quarter of an hour).

Static draws: no physics. What is wrong with a robot of six joints is drawn from what is stated of it, as a trial draws
it; its kinematics are exact, not linear, and of places where it really touches the robot knows what its encoders say.
It touches a table three times around the middle of the goals with the closed hand, lays a part that it holds flush, and
touches a wall from the side; each touch is off by a normal deviate. Of each setting: how often the 95 % region of the
unknowns, in the directions that touches tell (posterior variance below half of the prior one), covers the truth; the
same for all unknowns; for height, pitch and roll of the part at another place, one by one; their root mean squares
before and after; and in how many draws a right touch was refused. In the last settings one touch, any of the seven, is
of something else: how often it was refused. Percentages, and [mm] / [deg] / [deg]. With `--out` the table is kept.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from scipy.stats import chi2

from apo_bench.correction.calibration import UNKNOWN, RobotEstimate, Touch, prior_estimate, slip_sigmas
from apo_bench.geometry import Array, pose
from apo_bench.records import robot_sigmas
from apo_bench.records.robot_error import Sigmas

SEED = 31
MIDDLE = np.array([0.5, 0.0, 0.05])
UP = np.array([0.0, 0.0, 1.0])
AROUND = ((0.12, 0.0), (-0.07, 0.11), (-0.06, -0.12))
"""Where the table is touched, from the middle, [m]."""
WALL_M = 0.65
"""A wall across x, [m]."""
HELD = pose.at((0.0, 0.0, 0.015))
CORNERS = np.array([[-0.04, -0.015, 0.02], [0.04, -0.015, 0.02], [0.0, 0.015, 0.02]])
"""Of the face of the part that is laid flush, in its frame, [m]."""
LAID_AT = (0.42, -0.1)
SIDE = np.array([0.01, 0.0, -0.005])
"""The point of the closed hand that touches the wall, in the frame of the tip, [m]."""
GOAL = pose.at((0.55, 0.08, 0.1), (180.0, 0.0, 30.0))
"""Where the part is to be brought, upright."""
SCREWS = np.array(
    [[0, 0, 1, 0, 0, 0], [0, 1, 0, 0, 0, 0.15], [0, 1, 0, 0.2, 0, 0.5], [0, 1, 0, 0.5, 0, 0.35], [1, 0, 0, 0.5, 0, 0.3],
     [0, 0, 1, 0.5, 0, 0]],
    dtype=float,
)  # fmt: skip
"""Axis of each joint and a point on it at zero, [m], base frame: base, shoulder, elbow and three wrists."""
TWISTS = np.concatenate([np.cross(SCREWS[:, 3:], SCREWS[:, :3]), SCREWS[:, :3]], axis=1)
AT_ZERO = pose.at((0.5, 0.0, 0.1), (180.0, 0.0, 0.0))
"""The tip with all joints at zero."""
SETTINGS = (
    ("hand_eye:0.5/0.1", 20.0),
    ("tool:0.5", 20.0),
    ("joints:0.05", 20.0),
    ("in_hand:0.5/1", 20.0),
    ("hand_eye:0.5/0.1+joints:0.02+tool:0.2+in_hand:0.2/0.5", 20.0),
    ("not stated", 20.0),
    ("not stated", 5.0),
    ("not stated", 100.0),
    ("not stated", 20.0, 3.0),
    ("not stated", 20.0, 10.0),
)
"""What is wrong with the robot, the sigma of a touch, [um], and how far off one touch of something else is, [mm]."""


class Truth(NamedTuple):
    """What is wrong with one robot."""

    E: Array
    xi: Array
    tau: Array
    delta: Array
    gamma: Array


class Draw(NamedTuple):
    """One draw, after its touches."""

    observed: bool
    whole: bool
    directions: int
    part: np.ndarray
    """(3,): whether height, pitch and roll lie in their 95 % intervals."""
    before: Array
    """(3,): how far they are off without touches, [mm, deg, deg]."""
    after: Array
    refused: tuple[bool, ...]
    """Of each touch; if one is of something else, it is the first."""


def tip_of(q: Array) -> tuple[Array, Array]:
    """Where the joints (6,) put the tip, (4, 4), and the body Jacobian there, (6, 6): products of exponentials."""
    J = np.zeros((6, 6))
    T = AT_ZERO
    turned = pose.exp(TWISTS * q[:, None])
    for i in reversed(range(6)):
        J[:, i] = pose.adjoint(pose.inverse(T)) @ TWISTS[i]
        T = turned[i] @ T
    return T, J


def joints_at(T: Array, near: Array) -> Array:
    """Joints (6,) that put the tip at T, (4, 4): Newton's method from near ones, half a radian a step at most."""
    q = near
    for _ in range(100):
        at, J = tip_of(q)
        off = pose.log(pose.inverse(at) @ T)
        if np.abs(off).max() < 1e-12:
            break
        step = np.linalg.solve(J, off)
        q = q + step * min(1.0, 0.5 / np.abs(step).max())
    assert np.abs(off).max() < 1e-9, "a place that the arm does not reach"
    return q


def drawn(sigmas: Sigmas, rng: np.random.Generator) -> Truth:
    """As a trial draws it: hand and eye are apart by turns about x, y, z in turn, not by a twist."""
    mm, deg = sigmas.hand_eye
    unit = rng.standard_normal(6)
    displaced = pose.at(1e-3 * mm * unit[:3], deg * unit[3:])
    M = pose.at(MIDDLE)
    tau = 1e-3 * sigmas.tool_mm * rng.standard_normal(3)
    delta = np.radians(sigmas.joints_deg) * rng.standard_normal(6)
    _, y, z, turn, _, _ = slip_sigmas(sigmas) * rng.standard_normal(6)
    slipped = pose.log(pose.at((0.0, y, z), (np.degrees(turn), 0.0, 0.0)))
    return Truth(M @ displaced @ pose.inverse(M), pose.log(displaced), tau, delta, slipped)


@cache
def joints_near(x: float, y: float) -> Array:
    """Joints (6,) for a place low above the table, the tip looking down."""
    return joints_at(pose.at((x, y, 0.05), (180.0, 0.0, 0.0)), np.zeros(6))


def encoders(truth: Truth, T_world_tip: Array) -> tuple[Array, Array]:
    """Where the robot believes its tip, and its Jacobian there, when the tip really is at T, (4, 4)."""
    flange = pose.inverse(truth.E) @ T_world_tip @ pose.inverse(pose.at(truth.tau))
    x, y = np.round(T_world_tip[:2, 3], 2).tolist()
    return tip_of(joints_at(flange, joints_near(x, y)) - truth.delta)


def touches_of(truth: Truth, sigma_m: float, rng: np.random.Generator) -> Iterator[Touch]:
    """Three of the table, one of the wall, three corners of the part that lies flush."""

    def off(distance: float) -> float:
        return distance + sigma_m * rng.standard_normal()

    for x, y in AROUND:
        at = pose.at((MIDDLE[0] + x, MIDDLE[1] + y, 0.0), (180.0 + rng.normal(), rng.normal(), 30.0 * rng.normal()))
        B, J = encoders(truth, at)
        yield Touch(B, UP, off(0.0), np.zeros(3), sigma_m, J)
    B, J = encoders(truth, pose.at((WALL_M - SIDE[0], 0.05, 0.04), (180.0, 0.0, 0.0)))
    yield Touch(B, np.array([-1.0, 0.0, 0.0]), off(-WALL_M), SIDE, sigma_m, J)
    flush = pose.at((*LAID_AT, CORNERS[0, 2]), (180.0, 0.0, 20.0 * rng.normal()))
    B, J = encoders(truth, flush @ pose.inverse(pose.exp(truth.gamma) @ HELD))
    for corner in CORNERS:
        yield Touch(B, UP, off(0.0), corner, sigma_m, J, 0, HELD)


def draw(name: str, sigma_m: float, outlier_m: float, seed: int) -> Draw:
    rng = np.random.default_rng([SEED, seed])
    sigmas = stated(name)
    truth = drawn(sigmas, rng)
    prior = prior_estimate(sigmas, 6, MIDDLE).grasp(0, slip_sigmas(sigmas))
    touches = list(touches_of(truth, sigma_m, rng))
    if outlier_m:
        i = int(rng.integers(len(touches)))
        touches[i] = replace(touches[i], offset=touches[i].offset + outlier_m)
    belief = prior.touch(*touches)
    refused = tuple(any(t is one for one in belief.refused) for t in touches)
    if outlier_m:
        refused = (refused[i], *refused[:i], *refused[i + 1 :])

    unknowns = np.concatenate([truth.xi, truth.tau, truth.delta, truth.gamma])
    drawn_ones = np.flatnonzero(belief.sigmas)
    units = belief.sigmas[drawn_ones]
    off = (unknowns - belief.mean)[drawn_ones] / units
    C = belief.covariance[np.ix_(drawn_ones, drawn_ones)] / np.outer(units, units)
    variances, directions = np.linalg.eigh(C)
    squares = (directions.T @ off) ** 2 / variances
    told = variances < 0.5
    variances_there, after = part_at_goal(belief, truth)
    return Draw(
        bool(squares[told].sum() <= chi2.ppf(0.95, told.sum())),
        bool(squares.sum() <= chi2.ppf(0.95, len(squares))),
        int(told.sum()),
        np.abs(after) <= 1.959964 * np.sqrt(variances_there) + 1e-12,
        in_mm(part_at_goal(prior, truth)[1]),
        in_mm(after),
        refused,
    )


def part_at_goal(belief: RobotEstimate, truth: Truth) -> tuple[Array, Array]:
    """The variances of height, pitch and roll of the part when it is brought to its goal, (3,), and how far they really
    are off, (3,), [m, rad]."""
    near = joints_near(*GOAL[:2, 3].tolist())
    J = tip_of(joints_at(GOAL @ pose.inverse(HELD), near))[1]
    q = joints_at(belief.goal_tip(GOAL, 0, HELD, J), near)
    flange = tip_of(q + truth.delta)[0]
    reached = truth.E @ flange @ pose.at(truth.tau) @ pose.exp(truth.gamma) @ HELD
    command, J = tip_of(q)
    variances = np.diag(belief.covariance_of(command, J, 0, HELD))
    return variances[2:5], pose.log(pose.inverse(GOAL) @ reached)[2:5]


def in_mm(off: Array) -> Array:
    return np.array([1e3 * off[0], *np.degrees(off[1:])])


def stated(name: str) -> Sigmas:
    return UNKNOWN if name == "not stated" else robot_sigmas(name)


def summary(draws: int, name: str, sigma_um: float, outlier_mm: float = 0.0) -> dict[str, object]:
    """One row of the table."""
    made = [draw(name, 1e-6 * sigma_um, 1e-3 * outlier_mm, seed) for seed in range(draws)]

    def percent(values: list[bool]) -> str:
        return f"{100 * np.mean(values):.1f}"

    def rms(values: list[Array]) -> str:
        return " / ".join(f"{x:.3f}" for x in np.sqrt(np.mean(np.square(values), axis=0)))

    return {
        "robot_error": name,
        "sigma_um": f"{sigma_um:g}",
        "outlier_mm": f"{outlier_mm:g}",
        "draws": draws,
        "directions": f"{np.mean([one.directions for one in made]):.1f}",
        "told_covered": percent([one.observed for one in made]),
        "all_covered": percent([one.whole for one in made]),
        "part_covered": " / ".join(f"{100 * x:.1f}" for x in np.mean([one.part for one in made], axis=0)),
        "before_mm_deg_deg": rms([one.before for one in made]),
        "after_mm_deg_deg": rms([one.after for one in made]),
        "right_refused": percent([any(one.refused[bool(outlier_mm) :]) for one in made]),
        "outlier_refused": percent([one.refused[0] for one in made]) if outlier_mm else "",
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--draws", type=int, default=2000, help="of each setting (2000)")
    parser.add_argument("--out", type=Path, help="CSV file to write the table to")
    given = parser.parse_args()
    rows = []
    for setting in SETTINGS:
        rows.append(summary(given.draws, *setting))
        if len(rows) == 1:
            print("| " + " | ".join(rows[0]) + " |\n|" + "---|" * len(rows[0]))
        print("| " + " | ".join(map(str, rows[-1].values())) + " |", flush=True)
    if given.out:
        with given.out.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
