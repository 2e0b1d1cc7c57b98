"""Observe a demonstration through a noise model, and check what the model returned."""

from dataclasses import replace
from typing import Any

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Demonstration, Observation
from apo_bench.errors import RAISED, ArgumentError, InputError, failed, require
from apo_bench.geometry import is_rigid
from apo_bench.perception.observation.noise import Noise, NoiseLevel, make_noise
from apo_bench.records import parse_noise_level


@check_arguments
def observe(
    demonstration: Demonstration,
    noise: Noise | type | str,
    rng: np.random.Generator,
    *,
    noise_level: float | tuple[float, float] | None = None,
) -> Observation:
    """Observe a demonstration through a noise model.

    Args:
        demonstration: From `demonstrate`.
        noise: A name (`apo-bench noise list`), `"package.module:name"`, a noise file or a class, made with the noise
            level; or a function `(assembly, demonstration, rng) -> Observation`.
        rng: The only source of chance.
        noise_level: Standard deviation per axis in mm and degrees, one number for both or a pair. Default: 1.

    Returns:
        Noisy poses with their stated covariance.

    Raises:
        InputError: Unknown noise model; it raised an error or returned no observation of this demonstration; or a
            noise level was given with a function.
    """
    if isinstance(noise, str | type):
        noise = make_noise(noise, NoiseLevel(*parse_noise_level(1.0 if noise_level is None else noise_level)))
    elif noise_level is not None:
        raise InputError(
            f"the level {noise_level!r} was given together with a noise model that is made already; leave it out, "
            "or give the name or the class of the model."
        )
    name = getattr(noise, "__name__", type(noise).__name__)
    try:
        seen = noise(demonstration.assembly, demonstration, rng)
        complaint = _find_fault(demonstration, seen)
    except RAISED as error:
        if isinstance(error, InputError) and not isinstance(error, ArgumentError):
            raise
        raise failed(f"the noise model '{name}'", error) from error
    require(not complaint, f"the noise model '{name}' {complaint}.")
    return replace(seen, gap_m=demonstration.gap_m, play_m=demonstration.play_m)


def _find_fault(demonstration: Demonstration, seen: Any) -> str:
    """The fault of the value that a noise model returned, as the end of an error message; empty if it is valid."""
    if not isinstance(seen, Observation):
        return f"returned {type(seen).__name__}; return an apo_bench.assembly.Observation"
    if seen.assembly is not demonstration.assembly:
        return "changed the assembly, which is taken as certain; pass on the one it was given"
    if set(seen.start) != set(demonstration.start):
        return "changed which parts have a start pose; pass on `shown.start`"
    if not is_rigid(seen.poses).all():
        k = int(np.argmin(is_rigid(seen.poses)))
        return f"returned a pose of operation {k + 1} that is not rigid; return `shown.poses[k] @ exp(twist)`"
    # Checked on correlations, so that the units [m] and [rad] do not matter.
    deviation = np.sqrt(np.maximum(np.diagonal(seen.covariance, axis1=1, axis2=2), 1e-300))
    correlation = seen.covariance / (deviation[:, :, None] * deviation[:, None, :])
    off = np.abs(correlation - np.swapaxes(correlation, 1, 2)).max(axis=(1, 2), initial=0.0)
    wrong = np.flatnonzero((off >= 1e-9) | (np.linalg.eigvalsh(correlation)[:, 0] <= 1e-12))
    if wrong.size:
        return (
            f"returned a covariance for operation {wrong[0] + 1} that is not symmetric and positive definite; "
            "state a variance above zero in every direction"
        )
    return ""
