"""Make a noise model from its name, file, class or function."""

import inspect
import math
from collections.abc import Callable, Iterable
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import RAISED, InputError, failed, require, unknown
from apo_bench.names import resolve
from apo_bench.perception.observation.function_noise import make_function_noise
from apo_bench.perception.observation.models import NoiseLevel
from apo_bench.perception.observation.models.camera_failures import make_failures
from apo_bench.perception.observation.noise_file import list_noise_files, list_presets
from apo_bench.records import FAILURES

__all__ = ["FAILURES", "NOISES", "Noise", "NoiseLevel", "make_noise"]
Noise = Callable[[Assembly, Demonstration, np.random.Generator], Observation]
"""Any function `(assembly, shown, rng) -> Observation` is a noise model."""
NOISES = MappingProxyType(
    {
        "isotropic": "apo_bench.perception.observation.models.isotropic:IsotropicNoise",
        "anisotropic": "apo_bench.perception.observation.models.line_of_sight:AnisotropicNoise",
        "per-part": "apo_bench.perception.observation.models.isotropic:PerPartNoise",
        "camera": "apo_bench.perception.observation.models.line_of_sight:CameraNoise",
        "heavy-tailed": "apo_bench.perception.observation.models.isotropic:HeavyTailedNoise",
        "outliers": "apo_bench.perception.observation.models.outliers:OutlierNoise",
        "bias": "apo_bench.perception.observation.models.shared_bias:BiasNoise",
        "bias-view": "apo_bench.perception.observation.models.shared_bias:ViewBiasNoise",
        "correlated": "apo_bench.perception.observation.models.shared_bias:CorrelatedNoise",
        "symmetric": "apo_bench.perception.observation.models.symmetric_parts:SymmetricNoise",
        **dict.fromkeys(FAILURES, "apo_bench.perception.observation.models.camera_failures:make_failures"),
    }
)
_RATES = MappingProxyType({"p": "rate", "r": "repeat"})
"""Key in the name of a failure model (`flips:p=0.1/r=0.5`) -> argument of `make_failures`."""


def make_noise(given: Any, noise_level: NoiseLevel) -> Noise:
    """Make a noise model.

    Args:
        given: A name of `NOISES`; one of `FAILURES` with its rates (`flips:p=0.1/r=0.5`); `"package.module:name"`; a
            noise file (`.toml`, the name of one in the package, or `"empirical:"` and a file of residuals); `"poses:"`
            and a results file of the BOP format; or an object. A class is instantiated with the noise level. A function
            `(assembly, shown, rng) -> Observation` is used unchanged, and a function `(poses, rng) -> poses` needs
            attributes `deviation_mm`, `deviation_deg`.
        noise_level: Standard deviation per axis, [mm, degrees].

    Raises:
        InputError: There is no such noise model, it cannot be made or does not say how large its errors are, or the
            level is negative or not finite.
    """
    for value, unit in zip(noise_level, ("mm", "degrees"), strict=True):
        require(
            math.isfinite(value) and value >= 0.0,
            f"the noise level {value} {unit} is not possible; give a finite number, 0 or more.",
        )
    if isinstance(given, str):
        if list_noise_files(given):
            from apo_bench.perception.observation.noise_file import make_noise_of_file

            if (measured := make_noise_of_file(given, noise_level)) is not None:
                return measured
        if ":" not in given and given not in NOISES:
            raise InputError(_unknown_name_error(given, (*NOISES, *list_presets())))
        if given.partition(":")[0] in FAILURES:
            return _make_failures(given, noise_level)
    model = resolve(given, NOISES, "noise model")
    name = given if isinstance(given, str) else getattr(model, "__name__", type(model).__name__)
    try:
        return _instantiate(model, name, noise_level)
    except InputError:
        raise
    except RAISED as error:
        raise failed(f"the noise model '{name}'", error) from error


def _make_failures(given: str, noise_level: NoiseLevel) -> Noise:
    """Make the failure model of a name with rates, such as `flips:p=0.1/r=0.5`."""
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
    return make_failures(name, noise_level, **rates)


def _instantiate(model: Any, name: str, noise_level: NoiseLevel) -> Noise:
    """Make a noise model of a resolved object: instantiate a class, wrap a plain function `(poses, rng) -> poses`."""
    if isinstance(model, type):
        model = model(noise_level)
    # A function that accepts two or three arguments is plain if it declares its deviation.
    plain = _accepts_arguments(model, 2) and (hasattr(model, "deviation_mm") or not _accepts_arguments(model, 3))
    require(
        plain or _accepts_arguments(model, 3),
        f"the noise model '{name}' cannot be called with (assembly, shown, rng); give a function of these that returns "
        "an Observation.",
    )
    return make_function_noise(model, name) if plain else model


def _unknown_name_error(given: str, names: Iterable[str]) -> str:
    """The error message for an unknown name."""
    sentence = unknown("noise model", given, (*names, "empirical:FILE.csv", "poses:FILE.csv", "FILE.toml"))
    return sentence + " Or give your own as 'package.module:name'."


def _accepts_arguments(model: Any, arguments: int) -> bool:
    """True if `model` can be called with this number of positional arguments."""
    try:
        inspect.signature(model).bind(*[None] * arguments)
    except (TypeError, ValueError):
        return False
    return True
