"""Time correctors and compare them with the optimum: `python benchmarks/corrector.py [--draws N]` (two minutes).

Observations are Gaussian around an exactly consistent configuration, 2 mm and 1 degree per axis. The optimum is the
shortest whitened correction that closes every contact, found by SciPy's SLSQP on the contact equations; nothing of the
corrector is used for it. Writes docs/results/corrector.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from apo_bench.assembly import build_contact_equations

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.optimize import minimize

from apo_bench import Correction, Observation, correct, correct_many
from apo_bench.geometry import Array, compute_right_jacobian, pose
from benchmarks.corrector_problems import observe, problem

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "corrector.md"
PROBLEMS = ("fig2", "fig3", "fig6", "chain20")
WITH_OPTIMUM = ("fig2", "fig3", "fig6")
METHODS = ("paper", "least-squares", "contact", "contact-robust")
MANY = "contact-robust, 100 at once"


class Measured(NamedTuple):
    """The corrections of one method on one problem."""

    ms: float
    """Median processor time of one correction."""
    gap_mm: float
    """Largest contact gap that any correction leaves."""
    lengths: Array
    """|z| of each draw: the correction in standard deviations of the observation."""


def whitened(observation: Observation, poses: Array) -> Array:
    """Return z of a correction, (6 n,): T = T_observed exp(L z), L L^T = covariance."""
    twists = pose.log(pose.inverse(observation.poses) @ poses)
    return np.linalg.solve(np.linalg.cholesky(observation.covariance), twists[..., None]).ravel()


def find_optimum(observation: Observation, begin: Array) -> Array:
    """Return the shortest z that closes all contacts, (6 n,); the search starts at `begin`."""
    n = len(observation.poses)
    L = np.linalg.cholesky(observation.covariance)
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)

    def displace(z: Array) -> tuple[Array, Array]:
        xi = (L @ z.reshape(n, 6, 1))[..., 0]
        return xi, observation.poses @ pose.exp(xi)

    def gaps(z: Array) -> Array:
        return 1e3 * system.linearise(displace(z)[1])[0]

    def slopes(z: Array) -> Array:
        xi, poses = displace(z)
        J = system.linearise(poses)[1].reshape(-1, n, 6)
        return 1e3 * np.einsum("mki,kij->mkj", J, compute_right_jacobian(xi) @ L).reshape(-1, 6 * n)

    # SLSQP needs independent constraints: keep the directions that the contacts fix at the start.
    U, w, _ = np.linalg.svd(slopes(begin), full_matrices=False)
    kept = U[:, w > 1e-7 * w[0]].T
    closed = {"type": "eq", "fun": lambda z: kept @ gaps(z), "jac": lambda z: kept @ slopes(z)}
    options = {"maxiter": 500, "ftol": 1e-14}
    found = minimize(lambda z: z @ z, begin, jac=lambda z: 2.0 * z, constraints=closed, method="SLSQP", options=options)
    return np.asarray(found.x)


def spend(call: Callable[[], Sequence[Correction]]) -> tuple[float, Sequence[Correction]]:
    """Return the processor time of a call [ms], and its corrections."""
    start = time.process_time()
    made = call()
    return 1e3 * (time.process_time() - start), made


def measure(method: str, observations: Sequence[Observation]) -> Measured:
    """Time a method on every observation, after one call that warms up."""
    if method == MANY:
        correct_many(observations[:2])
        batches = [spend(partial(correct_many, (observations * 100)[:100]))]
        times = [ms / 100 for ms, _ in batches]
    else:
        correct(observations[0], method)
        batches = [spend(partial(correct_one, observation, method)) for observation in observations]
        times = [ms for ms, _ in batches]
    made = [correction for _, corrections in batches for correction in corrections][: len(observations)]
    lengths = [np.linalg.norm(whitened(o, c.poses)) for o, c in zip(observations, made, strict=True)]
    return Measured(float(np.median(times)), 1e3 * max(c.gap_after_m for c in made), np.array(lengths))


def correct_one(observation: Observation, method: str) -> Sequence[Correction]:
    """Correct one observation."""
    return (correct(observation, method),)


def page(measured: dict[tuple[str, str], Measured], optima: dict[str, Array], draws: int) -> str:
    """Return the page."""
    text = f"""# Speed and accuracy of correctors

Written by `python benchmarks/corrector.py --draws {draws}`: Fig. 2, 3 and 6 of the paper and a chain of 20
castles, with {draws} Gaussian observations each, 2 mm and 1 degree (1 sigma per axis).

## Time of a correction

Median processor time in ms, one thread, from an observation to its `Correction` with test and posterior.

{table(PROBLEMS, lambda name, method: f"{measured[name, method].ms:.2f}")}

## Remaining contact gap

Largest gap over all draws and contacts, in mm.

{table(PROBLEMS, lambda name, method: f"{measured[name, method].gap_mm:.1e}")}

## Distance from the optimum

A correction is as long as its whitened twist |z|, in standard deviations of the observation. The table has the largest
|z| / |z*| - 1 over all draws; z* is the shortest correction that SciPy's SLSQP finds. Methods that do not weight a
correction by the noise are longer.

{table(WITH_OPTIMUM, lambda name, method: f"{np.max(measured[name, method].lengths / optima[name]) - 1.0:.1e}")}
"""
    return text


def table(problems: Sequence[str], cell: Callable[[str, str], str]) -> str:
    """Return a table of Markdown: a line for each method, a column for each problem."""
    lines = [f"| method | {' | '.join(problems)} |", "|---" * (1 + len(problems)) + "|"]
    lines += [f"| `{m}` | {' | '.join(cell(name, m) for name in problems)} |" for m in (*METHODS, MANY)]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20, help="observations of each problem (20)")
    draws = parser.parse_args().draws
    measured = dict[tuple[str, str], Measured]()
    optima = dict[str, Array]()
    for name in PROBLEMS:
        of = problem(name)
        observations = [observe(of, seed) for seed in range(draws)]
        for method in (*METHODS, MANY):
            measured[name, method] = measure(method, observations)
        if name in WITH_OPTIMUM:
            begins = [whitened(observation, of.poses) for observation in observations]
            found = [find_optimum(o, z) for o, z in zip(observations, begins, strict=True)]
            optima[name] = np.array([np.linalg.norm(z) for z in found])
    PAGE.write_text(page(measured, optima, draws), encoding="utf-8")
    print(f"Wrote {PAGE}")


if __name__ == "__main__":
    main()
