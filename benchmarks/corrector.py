"""Time correctors and compare them with the optimum: `python benchmarks/corrector.py` (two minutes).

Observations are Gaussian around an exactly consistent configuration, 2 mm and 1 degree per axis. The optimum is the
shortest whitened correction that closes every contact, found by SciPy's SLSQP on the contact equations; nothing of the
corrector is used for it. `benchmarks.speed` puts the table on its page.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.assembly import build_contact_equations

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.optimize import minimize

from apo_bench import Correction, Observation, correct, correct_many
from apo_bench.geometry import Array, compute_right_jacobian, pose
from benchmarks.corrector_peers import peers
from benchmarks.corrector_problems import observe, problem
from benchmarks.rates_by_condition import table

PROBLEMS = ("fig2", "fig3", "fig6", "chain20")
WITH_OPTIMUM = ("fig2", "fig3", "fig6")
METHODS = ("paper", "least-squares", "contact", "contact-robust")
MANY = "contact, 100 at once"


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


def measure(method: Any, observations: Sequence[Observation]) -> Measured:
    """Time a method on every observation, after one call that warms up."""
    if method == MANY:
        correct_many(observations[:2], "contact")
        batches = [spend(partial(correct_many, (observations * 100)[:100], "contact"))]
        times = [ms / 100 for ms, _ in batches]
    else:
        correct(observations[0], method)
        batches = [spend(lambda o=observation: (correct(o, method),)) for observation in observations]
        times = [ms for ms, _ in batches]
    made = [correction for _, corrections in batches for correction in corrections][: len(observations)]
    lengths = [np.linalg.norm(whitened(o, c.poses)) for o, c in zip(observations, made, strict=True)]
    return Measured(float(np.median(times)), 1e3 * max(c.gap_after_m for c in made), np.array(lengths))


def table_of_correctors(draws: int = 20) -> list[str]:
    """Return lines of Markdown: time, gap and length of the corrections of every method, and of peers if installed."""
    methods: dict[str, Any] = {f"`{name}`": name for name in (*METHODS, MANY)} | peers()
    rows = {name: list[str]() for name in methods}
    gaps = dict.fromkeys(methods, 0.0)
    excess = dict.fromkeys(methods, 0.0)
    for name in PROBLEMS:
        of = problem(name)
        observations = [observe(of, seed) for seed in range(draws)]
        optima = None
        if name in WITH_OPTIMUM:
            optima = [np.linalg.norm(find_optimum(o, whitened(o, of.poses))) for o in observations]
        for label, method in methods.items():
            made = measure(method, observations)
            rows[label].append(f"{made.ms:.2f}")
            gaps[label] = max(gaps[label], made.gap_mm)
            if optima is not None:
                excess[label] = max(excess[label], float(np.max(made.lengths / optima)) - 1.0)
    heads = ("method", *PROBLEMS, "largest gap, mm", "excess length")
    return [
        "Median processor time of a correction in ms, one thread: figures of the paper and a chain of 20 castles,",
        f"{draws} observations each, 2 mm and 1 degree (1 sigma per axis). Excess length: the largest |z| / |z*| - 1",
        "in fig2, fig3 and fig6, with z* the shortest correction that SciPy's SLSQP finds.",
        "",
        *table(heads, [[name, *rows[name], f"{gaps[name]:.0e}", f"{excess[name]:.0e}"] for name in methods]),
    ]


if __name__ == "__main__":
    print(*table_of_correctors(), sep="\n")
