"""Compare two methods over the same seeds, so that layout, human error and noise are the same in each pair."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar, final

import numpy as np

from apo_bench.benchmark.analysis.condition import Condition, group_by_condition
from apo_bench.benchmark.analysis.rates import (
    CONFIDENCE,
    Interval,
    Rate,
    Records,
    compute_mean,
    compute_normal_quantile,
)
from apo_bench.geometry import Array
from apo_bench.records import TrialConfig, affects, knows_truth
from apo_bench.records.run.trials import Trials, make_trials

# settings that have their default if they do not affect the reference
_PAIRED_BY_DEFAULT = ("contact_source", "max_reobservations", "ft_sensor", "assumed_robot_error")
K = TypeVar("K", bound=Hashable)
REFERENCES = ("paper", "uncorrected")  # methods that others are compared with
_EDGE = 1e-9
"""Roots are sought this far from -1, 1 and the estimate, where the score statistic is undefined."""


@final
@dataclass(frozen=True)
class PairedComparison:
    """A method, compared with a reference method in one condition."""

    condition: Condition
    """The condition of the method."""
    reference: str
    pairs: int
    """Seeds at which both methods have a result."""
    only_method: int
    """Seeds at which only the method succeeded."""
    only_reference: int  # seeds at which only the reference succeeded
    both: int
    """Seeds at which both succeeded."""
    p: float | None
    """McNemar's exact p-value; None without a pair."""
    p_adjusted: float | None
    """The p-value after Holm's adjustment for all comparisons made together."""
    planned: int
    """Seeds at which both had a plan."""
    free_mm: float | None
    """Mean difference, method minus reference, of the error of planned poses in directions that contacts leave free."""
    free_interval: Interval | None
    """Student's 95 % interval of that mean; None with fewer than two pairs."""

    @property
    def difference(self) -> float | None:
        """Success rate of the method minus that of the reference; None without a pair."""
        return (self.only_method - self.only_reference) / self.pairs if self.pairs else None

    @property
    def interval(self) -> Interval:
        """Tango's 95 % interval of the difference."""
        return compute_tango_interval(self.only_method, self.only_reference, self.pairs)

    @property
    def neither(self) -> int:
        """Seeds at which both failed."""
        return self.pairs - self.both - self.only_method - self.only_reference

    @property
    def recovered(self) -> Rate:
        """Share of the reference's failures at which the method succeeded."""
        return Rate(self.only_method, self.only_method + self.neither)

    @property
    def harmed(self) -> Rate:
        """Share of the reference's successes at which the method failed."""
        return Rate(self.only_reference, self.only_reference + self.both)


def compare_pairs(records: Records, references: Sequence[str] = REFERENCES) -> tuple[PairedComparison, ...]:
    """Compare every method except the oracle with every reference, condition by condition, sorted as `tally` sorts.

    A setting that does not affect the reference has its default there, so one reference serves several conditions. The
    p-values of all comparisons are adjusted together; `a` against `b` and `b` against `a` count as one comparison.

    Raises:
        InputError: A trial occurs twice.
    """
    conditions = group_by_condition(make_trials(records)).items()
    counted = {condition: own.where(~np.isnan(own.number("success"))) for condition, own in conditions}
    cells = {condition: own for condition, own in counted.items() if len(own)}
    pairs = [
        _compare_trials(condition, reference, cells[condition], cells[other])
        for condition in cells
        for reference in references
        if not knows_truth(condition.method) and (other := get_reference_condition(condition, reference)) in cells
        if condition.method != reference
    ]
    raised = adjust_by_holm({_make_unordered_pair(pair): pair.p for pair in pairs if pair.p is not None})
    return tuple(replace(pair, p_adjusted=raised.get(_make_unordered_pair(pair))) for pair in pairs)


def adjust_by_holm(p: Mapping[K, float]) -> dict[K, float]:
    """Adjust p-values for multiple tests by Holm's method, which bounds the chance of one false alarm or more.

    After S. Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6 (1979),
    65-70.
    """
    tests = sorted(p, key=lambda test: p[test])
    # of m tests the i-th smallest p-value (from 0) is multiplied by m - i, and may not fall below the one before
    raised = np.maximum.accumulate([(len(p) - i) * p[test] for i, test in enumerate(tests)])
    adjusted = dict(zip(tests, np.minimum(raised, 1.0).tolist(), strict=True))
    return {test: adjusted[test] for test in p}


def get_reference_condition(condition: Condition, reference: str) -> Condition:
    """Return the condition of the reference that a condition, or a curve, is compared with.

    Settings that do not affect the reference have their defaults there.
    """
    usual = {name: getattr(TrialConfig, name) for name in _PAIRED_BY_DEFAULT if not affects(name, reference)}
    return replace(condition, method=reference, **usual)


def _make_unordered_pair(pair: PairedComparison) -> frozenset[Condition]:
    """Return the two compared conditions as an unordered pair."""
    return frozenset((pair.condition, get_reference_condition(pair.condition, pair.reference)))


def compute_mcnemar_p_value(only_first: int, only_second: int) -> float:
    """Return the two-sided exact p-value of a split of discordant pairs if both directions are equally likely.

    After Q. McNemar, Note on the sampling error of the difference between correlated proportions or percentages,
    Psychometrika 12 (1947), 153-157; exact by the binomial distribution. Without a discordant pair it is 1.

    Args:
        only_first: Pairs in which only the first succeeded.
        only_second: Pairs in which only the second succeeded.
    """
    from scipy.stats import binomtest

    pairs = only_first + only_second
    return float(binomtest(min(only_first, only_second), pairs, 0.5).pvalue) if pairs else 1.0


@lru_cache(maxsize=65536)
def compute_tango_interval(b: float, c: float, n: float) -> Interval:
    """Return Tango's 95 % score interval of a difference of paired proportions, (b - c) / n.

    It contains the differences at which Tango's score statistic is within the normal quantile z. Without a discordant
    pair it is 0 -+ z^2 / (n + z^2). After T. Tango, Equivalence test and confidence interval for the difference in
    proportions for the paired-sample design, Statistics in Medicine 17 (1998), 891-908.

    Args:
        b: Pairs in which only the first succeeded.
        c: Pairs in which only the second succeeded.
        n: All pairs, or an effective number of pairs, which is not whole; without any the interval is -1 to 1.
    """
    from scipy.optimize import brentq

    if n == 0:
        return Interval(-1.0, 1.0)
    z = compute_normal_quantile()
    d = (b - c) / n
    # the statistic falls from far above z at delta = -1 through 0 at the estimate d to far below -z at delta = 1
    # with c == n there is no root: the interval begins at -1
    low = -1.0 if c == n else brentq(lambda x: _compute_tango_score(b, c, n, x) - z, -1 + _EDGE, d - _EDGE)
    high = 1.0 if b == n else brentq(lambda x: _compute_tango_score(b, c, n, x) + z, d + _EDGE, 1 - _EDGE)
    return Interval(float(low), float(high))


def _compute_tango_score(b: float, c: float, n: float, delta: float) -> float:
    """Return Tango's score statistic for a difference delta.

    q is the likeliest probability of a pair of kind c, given that difference.
    """
    # q is the larger root of 2 n q^2 + B q - c delta (1 - delta) = 0, where the likelihood is flat along delta
    B = -b - c + (2 * n - b + c) * delta
    q = (np.sqrt(max(B * B + 8 * n * c * delta * (1 - delta), 0.0)) - B) / (4 * n)
    return float((b - c - n * delta) / np.sqrt(n * (2 * q + delta * (1 - delta))))


def _compare_trials(condition: Condition, reference: str, ours: Trials, theirs: Trials) -> PairedComparison:
    """Compare the trials of two methods at the seeds that both have."""
    _, i, j = np.intersect1d(ours.number("seed"), theirs.number("seed"), assume_unique=True, return_indices=True)
    ours = ours.where(i)
    theirs = theirs.where(j)
    right = ours.number("success") == 1
    other_right = theirs.number("success") == 1
    only_method = int((right & ~other_right).sum())
    only_reference = int((~right & other_right).sum())
    apart = ours.number("planned_error_free_mm") - theirs.number("planned_error_free_mm")
    apart = apart[~np.isnan(apart)]
    return PairedComparison(
        condition=condition,
        reference=reference,
        pairs=len(right),
        only_method=only_method,
        only_reference=only_reference,
        both=int((right & other_right).sum()),
        p=compute_mcnemar_p_value(only_method, only_reference) if len(right) else None,
        p_adjusted=None,
        planned=len(apart),
        free_mm=compute_mean(apart),
        free_interval=_compute_student_interval(apart),
    )


def _compute_student_interval(x: Array) -> Interval | None:
    """Return Student's 95 % interval of a mean, mean -+ t(n - 1) s / sqrt(n); None with fewer than two values."""
    from scipy.stats import sem, t

    if len(x) < 2:
        return None
    # equal values have no spread
    ends = t.interval(CONFIDENCE, len(x) - 1, loc=np.mean(x), scale=sem(x)) if np.ptp(x) else (x[0], x[0])
    return Interval(*map(float, ends))
