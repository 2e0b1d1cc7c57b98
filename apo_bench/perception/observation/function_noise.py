"""Wrap a plain function `(poses, rng) -> poses` as a noise model."""

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
"""Attributes that a function must declare -> largest allowed value."""


@final
@dataclass(frozen=True)
class FunctionNoise:
    """A noise model that returns the poses of a function, all observed, with the standard deviations it declares."""

    function: Callable[[Array, np.random.Generator], ArrayLike]
    """(true poses (n, 4, 4), generator) -> noisy poses (n, 4, 4), world frame, [m]. Its argument is a copy."""
    deviation_mm: float
    """Declared standard deviation along every axis."""
    deviation_deg: float
    """Declared standard deviation about every axis."""

    @property
    def __name__(self) -> str:
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        poses = np.array(self.function(demonstration.poses.copy(), rng), dtype=np.float64)
        sigma = np.repeat([self.deviation_mm * 1e-3, np.radians(self.deviation_deg)], 3)
        stated = floor_covariance(np.diag(sigma**2) + demonstration.human_error_covariance)
        return Observation(assembly, demonstration.start, poses, stated, np.ones(len(assembly), dtype=np.bool_))


def make_function_noise(function: Any, name: str) -> FunctionNoise:
    """Make a noise model of a function with the attributes `deviation_mm` and `deviation_deg`.

    Raises:
        InputError: An attribute is missing or out of range.
    """
    for field, largest in _LIMITS.items():
        value = getattr(function, field, None)
        require(
            isinstance(value, int | float) and 0.0 <= value <= largest,
            f"the noise model '{name}' is a function (poses, rng) whose {field} is {value!r}; set {name}.{field} to a "
            f"number from 0 to {largest:g}, or give (assembly, shown, rng) -> Observation.",
        )
    return FunctionNoise(function, function.deviation_mm, function.deviation_deg)
