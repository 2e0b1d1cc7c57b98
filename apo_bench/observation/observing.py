"""Observe a demonstration: what was shown, seen through a noise model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.errors import InputError, failed
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.rigid import is_rigid
from apo_bench.observation.noise import Noise


def observe(
    shown: Demonstration, noise: Noise, rng: np.random.Generator, gap_m: float = 1e-4, play_m: float = 0.0
) -> Observation:
    """What the noise model makes of a demonstration, checked.

    Args:
        noise: A function `(assembly, shown, rng) -> Observation`; `make_noise` finds one by name.
        rng: The only source of chance.
        gap_m: Largest |e| at which the contact equations will count as solved, [m].
        play_m: Clearance per side of parts that fit, [m].

    Raises:
        InputError: The noise model raised an error, or returned what is not an observation of this demonstration.
    """
    name = getattr(noise, "__name__", type(noise).__name__)
    try:
        seen = noise(shown.assembly, shown, rng)
        complaint = _complaint(shown, seen)
    except InputError:
        raise
    except Exception as error:
        raise failed(f"the noise model '{name}'", error) from error
    if complaint:
        raise InputError(f"the noise model '{name}' {complaint}.")
    return replace(seen, gap_m=gap_m, play_m=play_m)


def _complaint(shown: Demonstration, seen: Any) -> str:
    """What is wrong with what a noise model returned; empty if nothing is."""
    if not isinstance(seen, Observation):
        return f"returned {type(seen).__name__}; return an apo_bench.assembly.goals.Observation"
    if seen.assembly is not shown.assembly:
        return "changed the assembly, which is taken as certain; pass on the one it was given"
    if set(seen.start) != set(shown.start):
        return "changed which parts have a start pose; pass on `shown.start`"
    for wrong in np.flatnonzero(~is_rigid(seen.goals)):
        return (
            f"returned a goal for operation {wrong + 1} that is not a rigid pose; return `shown.goals[k] @ exp(twist)`"
        )
    for k, C in enumerate(seen.covariance):
        if not _positive_definite(C):
            return (
                f"returned a covariance for operation {k + 1} that is not symmetric and positive definite; "
                "state a variance above zero in every direction"
            )
    return ""


def _positive_definite(C: Array) -> bool:
    """Judged on correlations, so that [m] and [rad] weigh the same."""
    deviation = np.sqrt(np.maximum(np.diag(C), 1e-300))
    correlation = C / np.outer(deviation, deviation)
    return bool(np.abs(correlation - correlation.T).max() < 1e-9 and np.linalg.eigvalsh(correlation)[0] > 1e-12)
