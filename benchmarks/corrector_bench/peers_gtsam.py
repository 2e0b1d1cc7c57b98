"""GTSAM's Levenberg-Marquardt: a prior factor per goal, a custom factor per contact, a stated softness of contacts.

Needs `pip install gtsam`; without it these peers are left out. GTSAM writes a twist with the rotation first. Custom
factors call back into Python, which is what somebody does who has equations of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.geometry.arrays import Array
from benchmarks.corrector_bench.peers import Run, Task

SWAPPED = [3, 4, 5, 0, 1, 2]


def soft(soft_mm: float, solver: str) -> Callable[[Task], Run]:
    def prepare(task: Task) -> Run:
        import gtsam

        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for k, (T, cov) in enumerate(zip(task.seen, task.covariance, strict=True)):
            noise = gtsam.noiseModel.Gaussian.Covariance(cov[np.ix_(SWAPPED, SWAPPED)])
            graph.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), noise))
            values.insert(k, gtsam.Pose3(T))
        for contact in range(len(task.system.letters)):
            graph.add(_contact(gtsam, task, contact, soft_mm))
        settings = gtsam.LevenbergMarquardtParams()
        settings.setMaxIterations(200)
        settings.setRelativeErrorTol(1e-15)
        settings.setAbsoluteErrorTol(1e-15)
        settings.setLinearSolverType(solver)

        def run() -> Array:
            found = gtsam.LevenbergMarquardtOptimizer(graph, values, settings).optimize()
            return np.array([found.atPose3(k).matrix() for k in range(len(task.seen))])

        return run

    return prepare


def _contact(gtsam: Any, task: Task, contact: int, soft_mm: float) -> Any:
    """One factor for all vertices of a contact, on the goals in its word."""
    only = np.zeros(len(task.system.letters), dtype=bool)
    only[contact] = True
    system = task.system.among(only)
    keys = sorted(system.variables(len(task.seen)))
    few = _renumbered(system, keys, len(task.seen))

    def error(this: Any, values: Any, jacobians: Any) -> Array:
        goals = np.array([values.atPose3(k).matrix() for k in keys])
        if jacobians is None:
            return few.residual(goals)
        e, J = few.linearised(goals)
        for i in range(len(keys)):
            jacobians[i] = np.asfortranarray(J[:, 6 * i : 6 * i + 6][:, SWAPPED])
        return e

    noise = gtsam.noiseModel.Isotropic.Sigma(len(system), 1e-3 * soft_mm)
    return gtsam.CustomFactor(noise, keys, error)


def _renumbered(system: Any, keys: list[int], n: int) -> Any:
    """The same equations in the goals of `keys` alone."""
    from dataclasses import replace

    p = len(system.start)
    number = np.zeros(p + n + 1, dtype=np.intp)
    number[:p] = np.arange(p)
    number[p + np.array(keys, dtype=np.intp)] = p + np.arange(len(keys))
    number[p + n] = p + len(keys)
    return replace(system, letters=number[system.letters])


PEERS: Mapping[str, Callable[[Task], Run]] = MappingProxyType(
    {"gtsam cholesky": soft(1e-3, "MULTIFRONTAL_CHOLESKY"), "gtsam qr": soft(1e-5, "MULTIFRONTAL_QR")}
)
