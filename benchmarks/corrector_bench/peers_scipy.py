"""scipy's `least_squares`, given analytic derivatives and unknowns scaled by the noise.

`hard` minimises the contacts alone, as somebody would who wants them closed; tolerances at the level of rounding.
`soft` adds the prior |z|^2 and weighs contacts with a standard deviation of `SOFT_MM`: the statistically right cost,
up to that softness. `trf default` keeps scipy's own tolerances.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.geometry.arrays import Array
from benchmarks.corrector_bench.equations_in_z import InZ
from benchmarks.corrector_bench.peers import Run, Task

SOFT_MM = 2e-4
"""1e-4 of the 2 mm of noise: smaller ones slow the solvers down without gain."""
SHARP = MappingProxyType({"ftol": 1e-15, "xtol": 1e-15, "gtol": 1e-15, "max_nfev": 500})


def hard(**settings: Any) -> Callable[[Task], Run]:
    def prepare(task: Task) -> Run:
        from scipy.optimize import least_squares

        f = task.in_z
        return lambda: f.goals(least_squares(f.value, f.zero, jac=f.slope, **settings).x)

    return prepare


def soft(**settings: Any) -> Callable[[Task], Run]:
    def prepare(task: Task) -> Run:
        from scipy.optimize import least_squares

        f = task.in_z
        value, slope = _with_prior(f)
        return lambda: f.goals(least_squares(value, f.zero, jac=slope, **settings).x)

    return prepare


def _with_prior(f: InZ) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    eye = np.eye(len(f.zero))
    return (
        lambda z: np.concatenate([f.value(z) / SOFT_MM, z]),
        lambda z: np.concatenate([f.slope(z) / SOFT_MM, eye]),
    )


PEERS: Mapping[str, Callable[[Task], Run]] = MappingProxyType(
    {
        "scipy trf": hard(method="trf", **SHARP),
        "scipy trf default": hard(method="trf"),
        "scipy trf lsmr": hard(method="trf", tr_solver="lsmr", **SHARP),
        "scipy dogbox": hard(method="dogbox", **SHARP),
        "scipy lm": hard(method="lm", **SHARP),
        "scipy trf soft": soft(method="trf", **SHARP),
        "scipy lm soft": soft(method="lm", **SHARP),
    }
)
