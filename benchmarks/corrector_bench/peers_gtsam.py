"""GTSAM (Dellaert, 2012) as a corrector of somebody's own: contacts and prior of `least-squares` as a factor graph.

One `Pose3` per operation; a `PriorFactorPose3` with its stated covariance at what was seen; one `CustomFactor` per
contact ever made, with the face contact equations, their Jacobian and a standard deviation of `CONTACT_M`;
Levenberg-Marquardt with multifrontal QR, begun at what was seen, `TURNS` turns at most. GTSAM writes a twist with the
rotation first, and moves a pose by the same body twist as here.

Needs `pip install gtsam`. GTSAM and CasADi, which CadQuery solves with, hung now and then in one process, so this
refuses to start where CasADi is loaded.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from apo_bench.assembly import Correction, Equations, Observation
from apo_bench.assembly.equations import equations
from apo_bench.correction.baselines.penalty import CONTACT_M
from apo_bench.correction.checks.status import as_it_ends
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.errors import InputError
from apo_bench.geometry import Array

_TOLERANCE = 1e-12
TURNS = 100
_TURN_FIRST = np.array([3, 4, 5, 0, 1, 2])
"""(x, y, z, rx, ry, rz) -> GTSAM's order; its own inverse."""
_TURN_FIRST.flags.writeable = False


def gtsam(observation: Observation, *, contact_m: float = CONTACT_M) -> Correction:
    """The goals at which GTSAM's Levenberg-Marquardt ends.

    Args:
        contact_m: Standard deviation of e, [m].

    Returns:
        `converged` with the gap that is left in the sentence, or `not_seen`; `not_finite` if a number overflowed.

    Raises:
        InputError: GTSAM is not installed or cannot be loaded beside CasADi; a covariance is not positive definite.
    """
    module = _module()
    return as_it_ends(observation, lambda observation: _solved(module, observation, contact_m), "GTSAM came to an end")


def _module() -> Any:
    if "casadi" in sys.modules:
        raise InputError(
            "GTSAM was asked for where CasADi is loaded, and the two can hang in one process; "
            "run them in processes of their own."
        )
    try:
        import gtsam as module
    except ImportError as error:
        raise InputError(
            f"GTSAM was asked for, which cannot be imported ({error}); pip install gtsam, or use another corrector."
        ) from error
    return module


def _solved(gtsam: Any, observation: Observation, contact_m: float) -> Array:
    whitened(observation)  # GTSAM takes a covariance that is none without a word
    system = equations(observation.assembly, observation.start, observation.poses)
    n = len(observation.poses)
    graph = gtsam.NonlinearFactorGraph()
    values = gtsam.Values()
    for k, (T, covariance) in enumerate(zip(observation.poses, observation.covariance, strict=True)):
        noise = gtsam.noiseModel.Gaussian.Covariance(np.asfortranarray(covariance[np.ix_(_TURN_FIRST, _TURN_FIRST)]))
        graph.add(gtsam.PriorFactorPose3(k, gtsam.Pose3(T), noise))
        values.insert(k, gtsam.Pose3(T))
    for c in range(len(system.letters)):
        one = system.among(np.arange(len(system.letters)) == c)
        keys = list(one.variables(n))
        if keys:
            noise = gtsam.noiseModel.Isotropic.Sigma(len(one), contact_m)
            graph.add(gtsam.CustomFactor(noise, keys, _error(one, observation.poses)))
    settings = gtsam.LevenbergMarquardtParams()
    settings.setLinearSolverType("MULTIFRONTAL_QR")
    settings.setRelativeErrorTol(_TOLERANCE)
    settings.setAbsoluteErrorTol(_TOLERANCE)
    settings.setMaxIterations(TURNS)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, settings).optimize()
    return np.array([found.atPose3(k).matrix() for k in range(n)])


def _error(one: Equations, goals: Array) -> Callable[[Any, Any, Any], Array]:
    """e of one contact and, where asked for, its derivative by the pose of each key."""

    def error(this: Any, values: Any, jacobians: Any) -> Array:
        now = np.array(goals)
        keys = this.keys()
        for k in keys:
            now[k] = values.atPose3(k).matrix()
        if jacobians is None:
            return one.residual(now)
        e, J = one.linearised(now)
        for i, k in enumerate(keys):
            jacobians[i] = np.asfortranarray(J[:, 6 * k + _TURN_FIRST])
        return e

    return error
