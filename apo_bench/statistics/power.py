"""How many trials it takes: for a rate, for a difference over the same seeds, and for "not worse by more than".

Powers are exact sums over what can be seen, not normal approximations: with the few discordant pairs of good methods
those are far off. Of a pair, one method against a reference at one seed, `win` is the share at which the method alone
is right and `lose` that at which the reference alone is.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.statistics.paired import normal_quantile, score
from apo_bench.statistics.rates import Interval, wilson

ERROR = 0.05
"""Of a two-sided test."""
_POWER = 0.8
_MOST = 1_000_000
"""More trials than this are not sought."""
_FAR = 9.0
"""Standard deviations beyond which a count is not expected (less than 1e-18 of all cases)."""


@final
@dataclass(frozen=True)
class PowerEvidence:
    """What so many trials of each method, at the same seeds, can show."""

    trials: int
    half_width_50: float
    """Half the width of Wilson's 95 % interval at a rate of 0.5, where it is widest."""
    half_width_90: float
    all_right: Interval
    """The interval if all trials are right."""
    discordant: int | None
    """The fewest discordant pairs, all in favour of one method, that McNemar's test rejects at; None: not so many."""
    least_win: float | None
    """The least share of wins, without a loss, that the test shows with the power asked for; None: none."""
    margin: float
    """If no pair is discordant, neither method is worse by more than this (Tango's 95 % interval)."""


def rate_trials(rate: float, half_width: float) -> int:
    """The trials at which Wilson's 95 % interval of an expected rate reaches no further than `half_width` on average of
    its two sides."""
    _inside(rate, "rate", 0.0, 1.0, ends=True)
    _inside(half_width, "half width", 0.0, 0.5)
    return _least(lambda n: wilson_half_width(rate, n) <= half_width, "trials")


def wilson_half_width(rate: float, trials: int) -> float:
    """Half the width of Wilson's 95 % interval where the rate seen is `rate`."""
    z2 = normal_quantile() ** 2
    # Wilson: z sqrt(p (1 - p) / n + z^2 / 4 n^2) / (1 + z^2 / n)
    return float(np.sqrt(z2 * (rate * (1 - rate) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials))


def shares(rate: float, reference: float, agree: float | None = None) -> tuple[float, float]:
    """The shares of wins and losses of two success rates.

    Args:
        agree: The share of pairs that end alike; None: as alike as chance makes them if the two are independent.
    """
    _inside(rate, "rate", 0.0, 1.0, ends=True)
    _inside(reference, "rate", 0.0, 1.0, ends=True)
    if agree is None:
        return rate * (1 - reference), reference * (1 - rate)
    least = abs(1.0 - rate - reference)
    most = 1.0 - abs(rate - reference)
    require(
        least - 1e-9 <= agree <= most + 1e-9,
        f"an agreement of {agree:g} was given; success rates of {rate:g} and {reference:g} allow {least:g} to "
        f"{most:g} of the pairs to end alike.",
    )
    apart = 1.0 - agree
    # win + lose = apart, and win - lose = rate - reference
    return max(0.0, 0.5 * (apart + (rate - reference))), max(0.0, 0.5 * (apart - (rate - reference)))


def paired_trials(win: float, lose: float, power: float = _POWER, comparisons: int = 1) -> int:
    """The pairs at which McNemar's exact test shows which method is better, with a given power.

    Args:
        comparisons: How many tests are made together; each is held to its share of the error, as the first of Holm's.
    """
    _shares(win, lose)
    _inside(power, "power", 0.0, 1.0)
    if abs(win - lose) < 1e-12:
        raise InputError(
            f"{win:g} wins and {lose:g} losses were given; there is no difference to show, so ask for a margin instead."
        )
    error = _error(comparisons)
    return _least(lambda n: paired_power(n, win, lose, error) >= power, "pairs")


def paired_power(pairs: int, win: float, lose: float, error: float = ERROR) -> float:
    """How often McNemar's exact test rejects in favour of the method that is better, exactly.

    Summed over how many pairs are discordant; of m, at most k may fall the other way if 2 P(X <= k) <= error for X of m
    fair coins.
    """
    from scipy.stats import binom

    apart = win + lose
    if apart == 0.0:
        return 0.0
    m = _likely(pairs, apart)
    # ppf is the first count that is reached with error / 2: one less where it is passed
    k = np.asarray(binom.ppf(error / 2, m, 0.5))
    k = np.where(binom.cdf(k, m, 0.5) <= error / 2, k, k - 1)
    # of m discordant pairs each falls the other way with the smaller share of both
    rejects = np.where(k >= 0, binom.cdf(k, m, min(win, lose) / apart), 0.0)
    return float(np.sum(binom.pmf(m, pairs, apart) * rejects))


def margin_trials(margin: float, win: float = 0.0, lose: float = 0.0, power: float = _POWER) -> int:
    """The pairs at which Tango's 95 % interval shows that a method is not worse by `margin`, with a given power.

    With neither wins nor losses, the usual question between two good methods, z^2 / (n + z^2) must be below the margin.
    """
    _inside(margin, "margin", 0.0, 1.0)
    _shares(win, lose)
    _inside(power, "power", 0.0, 1.0)
    if win - lose <= -margin:
        raise InputError(
            f"{win:g} wins and {lose:g} losses were given for a margin of {margin:g}; a method that is worse by the "
            "margin cannot be shown not to be."
        )
    return _least(lambda n: margin_power(n, margin, win, lose) >= power, "pairs")


def margin_power(pairs: int, margin: float, win: float = 0.0, lose: float = 0.0) -> float:
    """How often the lower end of Tango's interval lies above minus the margin, exactly: summed over wins and losses."""
    from scipy.stats import binom

    b = _likely(pairs, win)[:, None]
    c = _likely(pairs, lose)[None, :]
    fits = b + c <= pairs
    rest = np.where(fits, pairs - b, 0)
    # a trinomial: wins out of all pairs, then losses out of those that are left
    weight = binom.pmf(b, pairs, win) * binom.pmf(c, rest, min(1.0, lose / (1 - win)) if win < 1 else 0.0)
    return float(
        np.sum(np.where(fits & (score(b, np.where(fits, c, 0), pairs, -margin) > normal_quantile()), weight, 0.0))
    )


def evidence(trials: int, power: float = _POWER, comparisons: int = 1) -> PowerEvidence:
    """What so many trials can show; see `PowerEvidence`."""
    from scipy.optimize import brentq

    require(1 <= trials <= _MOST, f"{trials} trials were given; a whole number from 1 to {_MOST} is allowed.")
    _inside(power, "power", 0.0, 1.0)
    error = _error(comparisons)
    z2 = normal_quantile() ** 2
    discordant = least_discordant(error)
    least_win = (
        float(brentq(lambda win: paired_power(trials, win, 0.0, error) - power, 1e-9, 1.0, xtol=1e-9))
        if discordant <= trials
        else None
    )
    return PowerEvidence(
        trials=trials,
        half_width_50=wilson_half_width(0.5, trials),
        half_width_90=wilson_half_width(0.9, trials),
        all_right=wilson(trials, trials),
        discordant=discordant if discordant <= trials else None,
        least_win=least_win,
        margin=float(z2 / (trials + z2)),
    )


def least_discordant(error: float) -> int:
    """The fewest discordant pairs, all in favour of one, at which a sign test rejects: 2 / 2^n <= error."""
    return math.ceil(1 - math.log2(error) - 1e-9)


def _least(enough: Callable[[int], bool], what: str) -> int:
    """The smallest number that is enough, where more hardly ever is not: doubled, halved, then one by one."""
    high = 1
    while not enough(high):
        high *= 2
        if high > _MOST:
            raise InputError(f"more than {_MOST} {what} would be needed; ask for less.")
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    while high > 1 and enough(high - 1):
        high -= 1
    return high


def _likely(n: int, p: float) -> Array:
    """The counts out of n that are not out of the question."""
    # the normal tail is too short where n p is small, so 40 more to either side
    far = _FAR * np.sqrt(n * p * (1 - p)) + 40.0 * (0.0 < p < 1.0)
    return np.arange(max(0, int(n * p - far)), min(n, int(np.ceil(n * p + far))) + 1, dtype=float)


def _error(comparisons: int) -> float:
    require(
        1 <= comparisons <= _MOST, f"{comparisons} comparisons were given; a whole number from 1 to {_MOST} is allowed."
    )
    return ERROR / comparisons


def _shares(win: float, lose: float) -> None:
    _inside(win, "share of wins", 0.0, 1.0, ends=True)
    _inside(lose, "share of losses", 0.0, 1.0, ends=True)
    if win + lose > 1.0 + 1e-9:
        raise InputError(f"shares of {win:g} wins and {lose:g} losses were given; together they may not exceed 1.")


def _inside(x: float, what: str, low: float, high: float, ends: bool = False) -> None:
    if not ((low <= x <= high) if ends else (low < x < high)):
        allowed = f"a number from {low:g} to {high:g}" if ends else f"a number between {low:g} and {high:g}"
        raise InputError(f"a {what} of {x:g} was given; {allowed} is allowed; 0.9 stands for 90 %.")
