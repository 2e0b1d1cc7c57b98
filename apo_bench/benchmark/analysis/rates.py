"""Success rates of conditions with Wilson's intervals."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.benchmark.analysis.condition import Condition, group_by_condition
from apo_bench.geometry import Array
from apo_bench.records.run.trials import Mask, Trials, make_trials

CONFIDENCE = 0.95
_CLASSES = 10  # classes of predicted success
Records = Trials | Iterable[Mapping[str, Any]]
"""Trials as columns, or as an iterable of records."""
NOT_EXECUTED = ("observe", "correct", "predicted-success", "plan", "worker")
"""Failure stages without an executed plan.

There was no plan, its predicted success was too low, the planner rejected it, or the worker process died.
"""


class Interval(NamedTuple):
    """A two-sided confidence interval."""

    low: float
    high: float


class Rate(NamedTuple):
    """A number of successes among a number of trials."""

    successes: int
    trials: int

    @property
    def rate(self) -> float | None:
        """Share of successes; None without a trial."""
        return self.successes / self.trials if self.trials else None

    @property
    def interval(self) -> Interval:
        """Wilson's 95 % interval of the rate."""
        return compute_wilson_interval(self.successes, self.trials)


@final
@dataclass(frozen=True, kw_only=True)
class ConditionResult(Condition):
    """The results of the trials of a condition."""

    trials: int
    """Trials that count: those whose demonstration was correct."""
    successes: int
    """Trials whose finished assembly is correct."""
    demonstrated: int
    """Successes in which every contact was also made when and where it was demonstrated."""
    loose_successes: int  # successes by the loose criteria
    not_executed: int
    """Failures without an executed plan: no correction, low predicted success, a rejected plan, or a dead worker."""
    abstained: int
    """Those of them with too low a predicted success."""
    predicted_success: float | None
    """Mean predicted success of the plans; None without a plan."""
    brier: float | None
    """Mean squared difference of predicted success and success over the executed plans."""
    excluded: int
    """Trials that count for no method, since the demonstration itself failed."""
    failures: Mapping[str, int]
    """`stage: code` -> number of failures, most frequent first."""

    @property
    def rate(self) -> float | None:
        """Success rate; None without a trial that counts."""
        return Rate(self.successes, self.trials).rate

    @property
    def interval(self) -> Interval:
        """Wilson's 95 % interval of the success rate."""
        return compute_wilson_interval(self.successes, self.trials)

    @property
    def tightness(self) -> float | None:
        """Clearance per side over noise level, both in mm: small is tight; None if poses are observed exactly."""
        return self.clearance_mm / self.noise_mm if self.noise_mm > 0 else None

    @property
    def demonstrated_rate(self) -> float | None:
        return Rate(self.demonstrated, self.trials).rate

    @property
    def loose_rate(self) -> float | None:
        return Rate(self.loose_successes, self.trials).rate

    @property
    def executed(self) -> Rate:
        """Successes among the trials whose plan was executed."""
        return Rate(self.successes, self.trials - self.not_executed)

    @property
    def wrong_when_executed(self) -> float | None:
        """Share of failures among the executed trials; None without one."""
        right = self.executed.rate
        return None if right is None else 1.0 - right


@lru_cache(maxsize=65536)
def compute_wilson_interval(successes: float, trials: float) -> Interval:
    """Return Wilson's 95 % score interval; 0 to 1 without trials.

    After E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927), 209-212.

    Args:
        trials: May be an effective number of trials, which is not whole.
    """
    if trials == 0:
        return Interval(0.0, 1.0)
    z = compute_normal_quantile()
    rate = successes / trials
    middle = (rate + z**2 / (2.0 * trials)) / (1.0 + z**2 / trials)
    half = z / (1.0 + z**2 / trials) * math.sqrt(rate * (1.0 - rate) / trials + (z / (2.0 * trials)) ** 2)
    # the exact ends of all and of nothing are not left to rounding
    return Interval(0.0 if successes == 0 else middle - half, 1.0 if successes == trials else middle + half)


@lru_cache(maxsize=1)
def compute_normal_quantile() -> float:
    """Return the normal quantile of a two-sided 95 % interval, 1.96."""
    from scipy.special import ndtri

    return float(ndtri((1.0 + CONFIDENCE) / 2.0))


def tally(records: Records) -> tuple[ConditionResult, ...]:
    """Count trials by condition, sorted as `make_sort_key` states.

    Raises:
        InputError: A trial occurs twice.
    """
    return tuple(_count_results(condition, own) for condition, own in group_by_condition(make_trials(records)).items())


def compute_mean(numbers: Array) -> float | None:
    """Return the mean of the numbers that are not NaN; None without any."""
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else None


def compute_root_mean_square(x: Array) -> float | None:
    """Return the root mean square; None without a number."""
    return math.sqrt(float(np.mean(x**2))) if len(x) else None


def was_executed(trials: Trials) -> Mask:
    """Return a mask, (n,), of trials whose plan was executed to its end or to a failure."""
    return ~trials.holds("failure_stage", NOT_EXECUTED.__contains__)


def _count_results(condition: Condition, trials: Trials) -> ConditionResult:
    """Return the results of the trials of a condition."""
    counted = trials.where(~np.isnan(trials.number("success")))  # success is unknown if the demonstration failed
    failed = counted.where(counted.number("success") == 0)
    why = Counter(map("{}: {}".format, failed.values("failure_stage"), failed.values("failure_code")))
    return ConditionResult(
        **vars(condition),
        trials=len(counted),
        successes=len(counted) - len(failed),
        demonstrated=int(np.nansum(counted.number("as_demonstrated"))),
        loose_successes=int(np.nansum(counted.number("loose_success"))),
        not_executed=int((~was_executed(counted)).sum()),
        abstained=sum(code == "abstained" for code in failed.values("failure_code")),
        predicted_success=compute_mean(counted.number("predicted_success")),
        brier=compute_brier_score(counted),
        excluded=len(trials) - len(counted),
        failures=MappingProxyType(dict(sorted(why.items(), key=lambda item: (-item[1], item[0])))),
    )


def compute_brier_score(counted: Trials) -> float | None:
    """Return the Brier score: the mean squared difference of predicted success and success over executed plans."""
    return compute_mean((counted.number("predicted_success") - counted.number("success"))[was_executed(counted)] ** 2)


def measure_reliability(counted: Trials) -> float | None:
    """Return how far predicted success is from the success rate over executed plans: 0 is calibrated.

    The plans are sorted into ten classes of equal width by their predicted success. The result is the mean squared
    difference of predicted success and success rate in the classes (A. H. Murphy, A new vector partition of the
    probability score, Journal of Applied Meteorology 12, 1973, 595-600). None without a prediction.
    """
    predicted = counted.number("predicted_success")
    known = ~np.isnan(predicted) & was_executed(counted)
    if not known.any():
        return None
    predicted = predicted[known]
    classes = np.minimum((predicted * _CLASSES).astype(int), _CLASSES - 1)
    apart = np.bincount(classes, predicted - counted.number("success")[known], minlength=_CLASSES)
    plans = np.bincount(classes, minlength=_CLASSES)
    return float((apart**2 / np.maximum(plans, 1)).sum() / len(predicted))
