"""A plain function `(goals, rng) -> goals` as a noise model, with the deviations that it declares."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.perception.observation.models import floored

_LIMITS = {"deviation_mm": 10000.0, "deviation_deg": 180.0}
"""What a function declares as attributes, and the largest that is allowed."""


@final
@dataclass(frozen=True)
class Plain:
    """The function's goals, all of them seen, with the deviations that it declares along and about every axis."""

    function: Callable[[Array, np.random.Generator], ArrayLike]
    """(n, 4, 4), world frame, [m], and chance; returns as many goals. It is given a copy."""
    deviation_mm: float
    deviation_deg: float

    def __post_init__(self) -> None:
        for field, largest in _LIMITS.items():
            value = getattr(self, field)
            require(
                isinstance(value, int | float) and 0.0 <= value <= largest,
                f"the noise model '{self.__name__}' declares {field} {value!r}; a number from 0 to {largest:g} is "
                "allowed.",
            )

    @property
    def __name__(self) -> str:
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        goals = np.array(self.function(demonstration.poses.copy(), rng), dtype=np.float64)
        sigma = np.repeat([self.deviation_mm * 1e-3, np.radians(self.deviation_deg)], 3)
        stated = floored(np.diag(sigma**2) + demonstration.human_error_covariance)
        return Observation(assembly, demonstration.start, goals, stated, np.ones(len(assembly), dtype=np.bool_))


def declared(function: Any, name: str) -> Plain:
    """A function with what it declares as its attributes `deviation_mm` and `deviation_deg`.

    Raises:
        InputError: It declares none, or what makes no sense.
    """
    missing = [field for field in _LIMITS if not hasattr(function, field)]
    require(
        not missing,
        f"the noise model '{name}' is a function (goals, rng) that does not say how large its errors are; set "
        f"{' and '.join(f'{name}.{field}' for field in missing)}, or give (assembly, shown, rng) -> Observation.",
    )
    return Plain(function, function.deviation_mm, function.deviation_deg)
