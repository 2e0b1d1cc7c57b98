"""GTSAM and Ceres as correctors: both minimise what `least-squares` does, with the same softness of contacts.

GTSAM (Dellaert, 2012): a prior with the stated covariance per pose, a factor per contact, Levenberg-Marquardt with
multifrontal QR. Ceres (Agarwal, Mierle et al.): one cost of all contacts with its Jacobian, one of the noise, dense QR.
`pip install gtsam pyceres`; a peer that is not installed is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from apo_bench import Observation
from apo_bench.assembly import Equations, build_contact_equations
from apo_bench.correction.baselines.least_squares import CONTACT_M, EVALUATIONS
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.geometry import Array

TOLERANCE = 1e-12
ROTATION_FIRST = [3, 4, 5, 0, 1, 2]  # (x, y, z, rx, ry, rz) in the order of GTSAM, and back


def peers() -> dict[str, Callable[[Observation], Array]]:
    """Return the peers that are installed, by name."""
    known = {"GTSAM": ("gtsam", correct_by_gtsam), "Ceres": ("pyceres", correct_by_ceres)}
    return {name: corrector for name, (module, corrector) in known.items() if find_spec(module)}


def correct_by_gtsam(observation: Observation) -> Array:
    """Return corrected poses, (n, 4, 4)."""
    import gtsam

    system = build_contact_equations(observation.assembly, observation.start, observation.poses)
    graph = gtsam.NonlinearFactorGraph()
    values = gtsam.Values()
    for k, (T, covariance) in enumerate(zip(observation.poses, observation.covariance, strict=True)):
        sorted_covariance = np.asfortranarray(covariance[np.ix_(ROTATION_FIRST, ROTATION_FIRST)])
        noise = gtsam.noiseModel.Gaussian.Covariance(sorted_covariance)
        graph.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), noise))
        values.insert(k, gtsam.Pose3(T))
    contacts = np.arange(len(system.letters))
    for c in contacts:
        one = system.among(contacts == c)
        if keys := list(one.variables(len(observation.poses))):
            noise = gtsam.noiseModel.Isotropic.Sigma(len(one), CONTACT_M)
            graph.add(gtsam.CustomFactor(noise, keys, _error_of(one, observation.poses)))
    settings = gtsam.LevenbergMarquardtParams()
    settings.setLinearSolverType("MULTIFRONTAL_QR")
    settings.setRelativeErrorTol(TOLERANCE)
    settings.setAbsoluteErrorTol(TOLERANCE)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, settings).optimize()
    return np.array([found.atPose3(k).matrix() for k in range(len(observation.poses))])


def _error_of(one: Equations, poses: Array) -> Callable[[Any, Any, Any], Array]:
    """e of one contact and its derivative by the pose of each key, as GTSAM calls it."""

    def error(this: Any, values: Any, jacobians: Any) -> Array:
        now = np.array(poses)
        keys = this.keys()
        for k in keys:
            now[k] = values.atPose3(k).matrix()
        e, J = one.linearise(now)
        if jacobians is not None:
            for i, k in enumerate(keys):
                jacobians[i] = np.asfortranarray(J[:, [6 * k + j for j in ROTATION_FIRST]])
        return e

    return error


def correct_by_ceres(observation: Observation) -> Array:
    """Return corrected poses, (n, 4, 4)."""
    import pyceres

    space = whitened(observation)
    n = len(observation.poses)
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)

    def slopes(z: Array) -> Array:
        return space.pull_back(z, system.linearise(space.poses(z))[1]) / CONTACT_M

    class Cost(pyceres.CostFunction):  # type: ignore[misc, name-defined]
        def __init__(self, m: int, value: Callable[[Array], Array], slope: Callable[[Array], Array]) -> None:
            super().__init__()
            self.value, self.slope, self.m = value, slope, m
            self.set_num_residuals(m)
            self.set_parameter_block_sizes([6] * n)

        def Evaluate(self, blocks: Sequence[Array], residuals: Array, jacobians: Sequence[Array] | None) -> bool:
            z = np.concatenate(blocks)
            residuals[:] = self.value(z)
            if jacobians is not None:
                J = self.slope(z).reshape(self.m, n, 6)
                for k, out in enumerate(jacobians):
                    if out is not None:
                        out[:] = J[:, k].ravel()
            return True

    z = [np.zeros(6) for _ in range(n)]
    asked = pyceres.Problem()
    costs = [
        Cost(len(system), lambda z: system.residual(space.poses(z)) / CONTACT_M, slopes),
        Cost(6 * n, lambda z: z, lambda z: np.eye(6 * n)),
    ]
    for cost in costs:
        asked.add_residual_block(cost, None, z)
    settings = pyceres.SolverOptions()
    settings.linear_solver_type = pyceres.LinearSolverType.DENSE_QR
    settings.max_num_iterations = EVALUATIONS
    settings.function_tolerance = settings.gradient_tolerance = settings.parameter_tolerance = TOLERANCE
    settings.num_threads = 1
    settings.logging_type = pyceres.LoggingType.SILENT
    pyceres.solve(settings, asked, pyceres.SolverSummary())
    return np.asarray(space.poses(np.concatenate(z)))
