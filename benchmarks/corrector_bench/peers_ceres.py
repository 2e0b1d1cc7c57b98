"""Ceres (Agarwal, Mierle et al.) as a corrector of somebody's own: what `least-squares` minimises, by `pyceres`.

Needs `pip install pyceres`; without it this peer is left out. One parameter block per operation, one cost for all
contacts with its analytic Jacobian, one for the stated noise; dense QR, tolerances and softness as `least-squares`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.assembly.equations import equations
from apo_bench.correction.baselines.penalty import CONTACT_M, EVALUATIONS
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.geometry import Array

TOLERANCE = 1e-12


def ceres(observation: Observation) -> Array:
    """Goals, (n, 4, 4)."""
    import pyceres

    space = whitened(observation)
    n = len(observation.poses)
    system = equations(observation.assembly, observation.start, observation.poses)

    def contacts(z: Array) -> Array:
        return system.residual(space.goals(z)) / CONTACT_M

    def slope(z: Array) -> Array:
        return space.pulled(z, system.linearised(space.goals(z))[1]) / CONTACT_M

    z = [np.zeros(6) for _ in range(n)]
    asked = pyceres.Problem()
    costs = [
        _cost(pyceres, len(system), n, contacts, slope),
        _cost(pyceres, 6 * n, n, lambda z: z, lambda z: np.eye(6 * n)),
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
    return space.goals(np.concatenate(z))


def _cost(pyceres: Any, m: int, n: int, value: Callable[[Array], Array], slope: Callable[[Array], Array]) -> Any:
    """m residuals of n blocks of six, with their derivative."""

    class Cost(pyceres.CostFunction):
        def __init__(self) -> None:
            super().__init__()
            self.set_num_residuals(m)
            self.set_parameter_block_sizes([6] * n)

        def Evaluate(self, blocks: Sequence[Array], residuals: Array, jacobians: Sequence[Array] | None) -> bool:
            z = np.concatenate(blocks)
            residuals[:] = value(z)
            if jacobians is not None:
                J = slope(z).reshape(m, n, 6)
                for k, out in enumerate(jacobians):
                    if out is not None:
                        out[:] = J[:, k].ravel()
            return True

    return Cost()
