"""A plain function `(poses, rng) -> poses` as a noise model."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.perception.observation.models import floor_covariance

_LIMITS = {"deviation_mm": 10000.0, "deviation_deg": 180.0}
"""What a function declares as attributes, and the largest that is allowed."""


@final
@dataclass(frozen=True)
class Plain:
    """The function's poses, all of them observed, with the deviations that it declares along and about every axis."""

    function: Callable[[Array, np.random.Generator], ArrayLike]
    """(n, 4, 4), world frame, [m], and chance; returns as many poses. Its argument is a copy."""
    deviation_mm: float
    deviation_deg: float

    @property
    def __name__(self) -> str:
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        poses = np.array(self.function(demonstration.poses.copy(), rng), dtype=np.float64)
        sigma = np.repeat([self.deviation_mm * 1e-3, np.radians(self.deviation_deg)], 3)
        stated = floor_covariance(np.diag(sigma**2) + demonstration.human_error_covariance)
        return Observation(assembly, demonstration.start, poses, stated, np.ones(len(assembly), dtype=np.bool_))


def declare(function: Any, name: str) -> Plain:
    """Make a noise model of a function with the attributes `deviation_mm` and `deviation_deg`.

    Raises:
        InputError: It declares none, or what makes no sense.
    """
    for field, largest in _LIMITS.items():
        value = getattr(function, field, None)
        require(
            isinstance(value, int | float) and 0.0 <= value <= largest,
            f"the noise model '{name}' is a function (poses, rng) whose {field} is {value!r}; set {name}.{field} to a "
            f"number from 0 to {largest:g}, or give (assembly, shown, rng) -> Observation.",
        )
    return Plain(function, function.deviation_mm, function.deviation_deg)
