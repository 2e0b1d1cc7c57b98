"""What a noise model is, and how to name one, or to take a plain function `(goals, rng) -> goals` for one."""

import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import InputError, failed, require, unknown
from apo_bench.geometry import Array
from apo_bench.names import resolve
from apo_bench.observation.models import Level, floored
from apo_bench.observation.models.failures import make_failures
from apo_bench.observation.noise_file import noise_path, presets
from apo_bench.records import FAILURES

__all__ = ["FAILURES", "NOISES", "Level", "Noise", "make_noise"]

Noise = Callable[[Assembly, Demonstration, np.random.Generator], Observation]
"""Any function `(assembly, shown, rng) -> Observation` is a noise model."""

NOISES = MappingProxyType(
    {
        "isotropic": "apo_bench.observation.models.isotropic:Isotropic",
        "anisotropic": "apo_bench.observation.models.camera:Anisotropic",
        "per-part": "apo_bench.observation.models.isotropic:PerPart",
        "camera": "apo_bench.observation.models.camera:Sighted",
        "heavy-tailed": "apo_bench.observation.models.isotropic:HeavyTailed",
        "outliers": "apo_bench.observation.models.outliers:Outliers",
        "bias": "apo_bench.observation.models.shared:Bias",
        "bias-view": "apo_bench.observation.models.shared:BiasView",
        "correlated": "apo_bench.observation.models.shared:Correlated",
        "symmetric": "apo_bench.observation.models.symmetric:Symmetric",
        **dict.fromkeys(FAILURES, "apo_bench.observation.models.failures:make_failures"),
    }
)
_RATES = MappingProxyType({"p": "rate", "r": "repeat"})
"""What may be stated of a camera that fails now and then -> what it is called there."""
_LIMITS = {"deviation_mm": 10000.0, "deviation_deg": 180.0}
"""What a function declares as attributes, and the largest that is allowed."""


def make_noise(given: Any, level: Level) -> Noise:
    """The noise model that a name stands for.

    Args:
        given: A name out of `NOISES`, one out of `FAILURES` with its rates (`flips:p=0.1/r=0.5`),
            `"package.module:name"`, a noise file (`.toml`, the name of one that comes with the package, or
            `"empirical:"` and a file of residuals), or the object: a class is made with the level, a function
            `(assembly, shown, rng) -> Observation` is used as it is, and so is a plain `(goals, rng) -> goals` that has
            attributes `deviation_mm` and `deviation_deg`.
        level: How much noise.

    Raises:
        InputError: There is no such noise model, it cannot be made or does not say how large its errors are, or the
            level is negative or not finite.
    """
    for value, unit in zip(level, ("mm", "degrees"), strict=True):
        require(
            math.isfinite(value) and value >= 0.0,
            f"the noise level {value} {unit} is not possible; give a finite number, 0 or more.",
        )
    if isinstance(given, str):
        if noise_path(given) is not None:
            from apo_bench.observation.noise_file import noise_of_file

            if (measured := noise_of_file(given, level)) is not None:
                return measured
        if ":" not in given and given not in NOISES:
            raise InputError(_unknown(given, (*NOISES, *presets())))
        if given.partition(":")[0] in FAILURES:
            return _failing(given, level)
    model = resolve(given, NOISES, "noise model")
    name = given if isinstance(given, str) else getattr(model, "__name__", type(model).__name__)
    try:
        return _noise(model, name, level)
    except InputError:
        raise
    except Exception as error:
        raise failed(f"the noise model '{name}'", error) from error


def _failing(given: str, level: Level) -> Noise:
    """A camera that fails now and then, as often as its name says: `flips:p=0.1/r=0.5`."""
    name, colon, stated = given.partition(":")
    entries = [entry.partition("=") for entry in stated.split("/")] if colon else []
    try:
        rates = {_RATES[key]: float(number) for key, _, number in entries}
        require(len(rates) == len(entries), "twice")
    except (KeyError, ValueError):
        raise InputError(
            f"the noise '{given}' was given; state how often the camera fails, '{name}:p=0.1', or also how often a "
            f"later look repeats a failure, '{name}:p=0.1/r=0.5'."
        ) from None
    return make_failures(name, level, **rates)


def _noise(model: Any, name: str, level: Level) -> Noise:
    """What can be called, from what a name stands for."""
    if isinstance(model, type):
        _check(model, 1, f"the noise model '{name}' is a class that cannot be made with one argument, the level")
        model = model(level)
    if _takes(model, 2) and (hasattr(model, "deviation_mm") or not _takes(model, 3)):
        return declared(model, name)
    _check(model, 3, f"the noise model '{name}' cannot be called with (assembly, shown, rng)")
    noise: Noise = model
    return noise


def _unknown(given: str, names: Iterable[str]) -> str:
    """What to say to a name that is none."""
    if given.lower().endswith(".csv"):
        return (
            f"unknown noise model '{given}'; did you mean 'empirical:{given}'? That takes residuals, which "
            "`apo-bench noise fit --residuals` writes; its --out writes a noise file, whose name ends in .toml."
        )
    sentence = unknown("noise model", given, (*names, "empirical:FILE.csv", "FILE.toml"))
    return sentence + " Or give your own as 'package.module:name'."


def _takes(model: Any, arguments: int) -> bool:
    """Whether it can be called with so many arguments."""
    try:
        inspect.signature(model).bind(*[None] * arguments)
    except (TypeError, ValueError):
        return False
    return True


def _check(model: Any, arguments: int, complaint: str) -> None:
    require(_takes(model, arguments), f"{complaint}; give a function (assembly, shown, rng) -> Observation.")


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
            number = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
            require(
                number and math.isfinite(value) and 0.0 <= value <= largest,
                f"the noise model '{self.__name__}' declares {field} {value!r}; a number from 0 to {largest:g} is "
                "allowed.",
            )

    @property
    def __name__(self) -> str:
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        goals = np.array(self.function(demonstration.goals.copy(), rng), dtype=np.float64)
        sigma = np.repeat([self.deviation_mm * 1e-3, np.radians(self.deviation_deg)], 3)
        stated = floored(np.diag(sigma**2) + demonstration.careless)
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
