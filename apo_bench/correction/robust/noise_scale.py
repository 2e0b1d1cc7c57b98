"""Estimate of the ratio s of the actual noise to the stated noise, from the length of the correction.

If all errors are s times as large, the correction is s times as long and the poses are the same. So the squared length
and its degrees of freedom determine s without another solution. The prior of log s is normal.
"""

from dataclasses import replace

import numpy as np

from apo_bench.assembly import Consistency, Observation
from apo_bench.correction.checks.chi_square import p_value

SPREAD = 1.0
"""Prior standard deviation of log s: noise twice as large as stated is nothing unusual."""
SCALED = 0.1
"""Prior probability that the noise differs from what is stated."""
LEAST = 1.15
"""Scales below this count as 1."""
_SAID = 1.5
"""Scales below this are not mentioned in the sentence, since they happen by chance."""
_LARGEST = 10.0
"""Largest scale that is considered."""
_STEPS = 30
"""Most Newton steps."""


def likeliest_scale(chi_square: float, freedom: int) -> float:
    """The most likely s, at least 1, given the squared length of a correction and its degrees of freedom."""
    # -2 log of the posterior of t = log s is chi^2 exp(-2 t) + 2 f t + (t / SPREAD)^2, which is convex: Newton.
    if not np.isfinite(chi_square) or freedom < 1:
        return 1.0
    t = 0.0
    for _ in range(_STEPS):
        q = chi_square * np.exp(-2.0 * t)
        step = (q - freedom - t / SPREAD**2) / (2.0 * q + 1.0 / SPREAD**2)
        t += float(np.clip(step, -0.5, 0.5))
        if abs(step) < 1e-9:
            break
    return float(np.clip(np.exp(t), 1.0, _LARGEST))


def scale_surprise(scale: float, freedom: int) -> float:
    """-2 log of the prior probability of a noise scale, within the precision to which the correction determines it."""
    width = 1.0 / np.sqrt(2.0 * freedom + 1.0 / SPREAD**2)
    prior = (np.log(scale) / SPREAD) ** 2 - 2.0 * np.log(width / SPREAD)
    return float(prior - 2.0 * np.log(SCALED / (1.0 - SCALED)))


def region_scale(scale: float, freedom: int) -> float:
    """Factor for the size of regions: the scale, enlarged since it is estimated, as in Student's t."""
    return scale * float(np.sqrt(1.0 + 2.0 / freedom)) if scale > 1.0 else 1.0


def scaled_test(test: Consistency, scale: float) -> Consistency:
    """The test with noise `scale` times as large; estimating the scale costs one degree of freedom."""
    chi_square = test.chi_square / scale**2
    freedom = max(test.freedom - 1, 0)
    return replace(test, chi_square=chi_square, freedom=freedom, p_value=p_value(chi_square, freedom))


def scale_noise(observation: Observation, scale: float) -> Observation:
    """The observation with all its stated noise multiplied by `scale`."""
    shared = tuple(replace(error, covariance=error.covariance * scale**2) for error in observation.shared)
    tails = observation.tails
    if tails is not None:
        tails = replace(
            tails, scales=tails.scales * scale, variances=tails.variances * scale**2, limits=tails.limits * scale
        )
    return replace(observation, covariance=observation.covariance * scale**2, shared=shared, tails=tails)


def scale_words(scale: float) -> str:
    """`; about twice as noisy as stated`, or empty."""
    if scale < _SAID:
        return ""
    times = "twice" if 1.75 <= scale < 2.25 else f"{scale:.1f} times" if scale < 3.0 else f"{scale:.0f} times"
    return f"; about {times} as noisy as stated"
