"""The noise under which what contacts tell of many observations is most likely, with intervals.

The covariance of the body twists of an observation is a sum of components with unknown deviations, S = sum s_i^2 F_i
F_i^t: errors along the rays of a camera, across them, errors that all operations share. Each operation is grossly wrong
with an unknown rate, and then tells nothing. With constants left out, the logarithm of the likelihood is the sum over
observations of

    log sum over sets g of gross operations  rate^|g| (1 - rate)^(n - |g|) N(B_g xi; m, B_g S B_g^t) / R^d

where d directions that would be fixed are not, of an error that may be anything within R (type-II maximum likelihood;
MacKay, "Bayesian interpolation", 1992). A constant error of the camera has m = B_g A c.

What the contacts of one observation tell of its noise: the errors in the directions that they fix.

At corrected goals contacts fix some directions of the body twists xi and leave the others free. In the fixed ones the
corrected goals are as good as the truth, so B xi, with the rows of B an orthonormal basis of them, is an error that is
known without the truth: Gaussian with covariance B S B^t if xi has the covariance S. An operation that is grossly wrong
tells nothing of S; without it, and without the contacts in which it has a part, fewer directions are fixed.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Observation, lowered_observation
from apo_bench.assembly.equations import equations
from apo_bench.assembly.pattern import pattern
from apo_bench.correction.solvers import RANK_CUT_OFF, compact_equations, fit_covariance
from apo_bench.geometry import Array, frozen, pose

UNITS = frozen(np.repeat([1e-3, np.radians(1.0)], 3))
"""(6,): the unit of body twists here, 1 mm and 1 deg."""


@final
@dataclass(frozen=True, eq=False)
class Reading:
    """The errors that are known if some operations are grossly wrong."""

    gross: frozenset[int]
    """These operations, counted from 0."""
    known: Array
    """(r,): B xi, in `UNITS`."""
    fixed: Array
    """(r, 6 n): B."""
    play: Array
    """(r, r): the covariance that the play of parts that fit adds."""


def readings(observation: Observation, goals: Array, sets: Iterable[Collection[int]]) -> tuple[Reading, ...]:
    """What is known of the errors of an observation, for each set of operations that may be grossly wrong.

    Args:
        goals: (n, 4, 4), corrected, consistent with every contact.
    """
    observation = lowered_observation(observation)
    n = len(goals)
    system = compact_equations(equations(observation.assembly, observation.start, goals), n)
    _, blocks = system.blocks(goals, np.broadcast_to(np.diag(UNITS), (n, 6, 6)))
    J = system.gathered(blocks).T
    xi = (pose.log(pose.inverse(goals) @ observation.goals) / UNITS).ravel()
    play = fit_covariance(observation.assembly, observation.play_m)
    operations = pattern(observation.assembly).letters - len(observation.assembly.solids)
    known = []
    for gross in sets:
        kept = np.repeat(~np.isin(operations, list(gross)).any(axis=1), 3)
        U, w, Vt = np.linalg.svd(J[kept], full_matrices=False)
        r = int(np.count_nonzero(w > RANK_CUT_OFF * w.max(initial=0.0))) if w.size and w[0] > 0.0 else 0
        by = U[:, :r] / w[:r]
        S = np.zeros((r, r)) if play is None else by.T @ play[np.ix_(kept, kept)] @ by
        known.append(Reading(frozenset(gross), Vt[:r] @ xi, Vt[:r], S))
    return tuple(known)


GROSS_RANGE = 300.0
"""R: how far a gross error may lead in one direction, [mm] and [deg]."""
LEAST_DEVIATION = 1e-3
"""The least deviation of a component, [mm] or [deg]: none."""
_LEAST_RATE = 1e-4
_MOST_RATE = 0.6
_DROP = 1.92
_WIDE = 1.96
"""The logarithm of the likelihood falls by this from its largest value to the end of a 95 % interval, which is so many
standard deviations wide on either side."""
_NUDGE = 1e-3


@final
@dataclass(frozen=True, eq=False)
class ObservedErrors:
    """What is known of one observation."""

    readings: tuple[Reading, ...]
    factors: tuple[Array, ...]
    """F_i of each component, (6 n, r_i), in mm and degrees."""
    constant: Array
    """(6 n, 6): A, what a constant error of the camera makes of the body twists."""
    n: int
    unseen: frozenset[int] = frozenset()
    """Operations that were not seen: they are in every set, and count for no rate."""


class EstimatedNumber(NamedTuple):
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float


@final
@dataclass(frozen=True, eq=False)
class LearnedNoise:
    """What was learned."""

    deviations: tuple[EstimatedNumber, ...]
    """Of each component, [mm] or [deg]; a low end of 0 says that it may be missing."""
    gross: EstimatedNumber
    """Part of the operations that are grossly wrong."""
    constant: Array
    """(6,), the constant error, [mm, deg]; zero if it was not asked for."""
    constant_covariance: Array
    """(6, 6), of that."""
    log_likelihood: float
    observations: int


def learn_noise(observations: Sequence[ObservedErrors], start: Sequence[float], constant: bool) -> LearnedNoise:
    """The most likely noise.

    Args:
        start: A first guess at each deviation, [mm] or [deg].
        constant: Whether the camera has a constant error too.
    """
    from scipy.optimize import minimize

    k = len(start)
    c = np.zeros(6)
    C = np.zeros((6, 6))
    x = np.array([*(2.0 * np.log(np.maximum(start, LEAST_DEVIATION))), _logit(0.05)])
    low = [2.0 * np.log(LEAST_DEVIATION)] * k + [_logit(_LEAST_RATE)]
    bounds = list(zip(low, [2.0 * np.log(GROSS_RANGE)] * k + [_logit(_MOST_RATE)], strict=True))
    prepared = [_prepared(one) for one in observations]
    for _ in range(4 if constant else 1):
        best = minimize(_surprise, x, args=(prepared, c), jac=True, bounds=bounds, method="L-BFGS-B")
        x = np.asarray(best.x)
        if constant:
            before = c
            c, C = _constant(prepared, x)
            if np.abs(c - before).max() < 1e-3:
                break
    ends = _intervals(x, prepared, c, *np.array(bounds).T)
    deviations = tuple(
        EstimatedNumber(float(np.exp(x[i] / 2)), 0.0 if a <= low[i] else float(np.exp(a / 2)), float(np.exp(b / 2)))
        for i, (a, b) in enumerate(ends[:k])
    )
    rate = EstimatedNumber(*(float(_expit(v)) for v in (x[k], *ends[k])))
    return LearnedNoise(deviations, rate, c, C, -_surprise(x, prepared, c)[0], len(observations))


class _Ready(NamedTuple):
    """A reading with the matrices that do not depend on what is learned."""

    known: Array
    parts: Array
    """(k, r, r): B F_i F_i^t B^t."""
    play: Array
    constant: Array
    """(r, 6): B A."""
    gross: int
    fixed_less: int


class _Prepared(NamedTuple):
    readings: tuple[_Ready, ...]
    n: int


def _prepared(observation: ObservedErrors) -> _Prepared:
    most = max((len(one.known) for one in observation.readings), default=0)
    prepared = []
    for one in observation.readings:
        spans = [one.fixed @ F for F in observation.factors]
        parts = np.array([f @ f.T for f in spans]).reshape(len(observation.factors), len(one.known), len(one.known))
        less = most - len(one.known)
        gross = len(one.gross - observation.unseen)
        prepared.append(_Ready(one.known, parts, one.play, one.fixed @ observation.constant, gross, less))
    return _Prepared(tuple(prepared), observation.n - len(observation.unseen))


def _surprise(x: Array, prepared: Sequence[_Prepared], c: Array) -> tuple[float, Array]:
    """-log likelihood and its derivative by log s_i^2 and the logit of the rate."""
    total = 0.0
    slope = np.zeros(len(x))
    rate = _expit(x[-1])
    for one in prepared:
        logs, slopes = _by_set(x, one, c)
        top = logs.max()
        weights = np.exp(logs - top)
        total -= top + np.log(weights.sum())
        weights /= weights.sum()
        slope[:-1] -= weights @ slopes
        slope[-1] -= weights @ np.array([ready.gross - rate * one.n for ready in one.readings])
    return total, slope


def _by_set(x: Array, one: _Prepared, c: Array) -> tuple[Array, Array]:
    """The logarithm of the weight of each set, (m,), and its derivative by log s_i^2, (m, k)."""
    variance = np.exp(x[:-1])
    rate = _expit(x[-1])
    logs = np.empty(len(one.readings))
    slopes = np.zeros((len(one.readings), len(x) - 1))
    for j, ready in enumerate(one.readings):
        logs[j] = (
            ready.gross * np.log(rate)
            + (one.n - ready.gross) * np.log1p(-rate)
            - ready.fixed_less * np.log(GROSS_RANGE)
        )
        r = len(ready.known)
        if not r:
            continue
        S = np.tensordot(variance, ready.parts, 1) + ready.play + LEAST_DEVIATION**2 * np.eye(r)
        inverse = np.linalg.inv(S)
        off = ready.known - ready.constant @ c
        y = inverse @ off
        logs[j] -= 0.5 * (off @ y + np.linalg.slogdet(S)[1] + r * np.log(2.0 * np.pi))
        slopes[j] = 0.5 * variance * (ready.parts @ y @ y - np.einsum("kab,ab->k", ready.parts, inverse))
    return logs, slopes


def _constant(prepared: Sequence[_Prepared], x: Array) -> tuple[Array, Array]:
    """The most likely constant error given the rest, (6,), and its covariance, (6, 6), each set by its weight."""
    H = np.eye(6) / GROSS_RANGE**2
    g = np.zeros(6)
    variance = np.exp(x[:-1])
    for one in prepared:
        logs, _ = _by_set(x, one, np.zeros(6))
        ready = one.readings[int(np.argmax(logs))]
        S = np.tensordot(variance, ready.parts, 1) + ready.play + LEAST_DEVIATION**2 * np.eye(len(ready.known))
        W = np.linalg.solve(S, ready.constant)
        H = H + ready.constant.T @ W
        g = g + W.T @ ready.known
    C = np.linalg.inv(H)
    return C @ g, (C + C.T) / 2


def _intervals(x: Array, prepared: Sequence[_Prepared], c: Array, low: Array, high: Array) -> list[tuple[float, float]]:
    """The ends of an interval for each coordinate: by the curvature of the valley, or how far it may leave its bound.

    A component without which the likelihood falls by less than `_DROP` may be missing.
    """
    m = len(x)
    H = np.empty((m, m))
    for j, step in enumerate(_NUDGE * np.eye(m)):
        H[j] = (_surprise(x + step, prepared, c)[1] - _surprise(x - step, prepared, c)[1]) / (2 * _NUDGE)
    inside = (x > low + _NUDGE) & (x < high - _NUDGE)
    C = np.linalg.pinv((H + H.T)[np.ix_(inside, inside)] / 2, hermitian=True)
    wide = np.zeros(m)
    wide[inside] = _WIDE * np.sqrt(np.maximum(np.diag(C), 0.0))
    value = _surprise(x, prepared, c)[0]
    ends = list[tuple[float, float]]()
    for j in range(m):
        without = np.where(np.arange(m) == j, low, x)
        if inside[j] and _surprise(without, prepared, c)[0] - value > _DROP:
            ends.append((max(x[j] - wide[j], low[j]), min(x[j] + wide[j], high[j])))
            continue
        near = x[j]
        far = high[j]
        while far - near > _NUDGE and x[j] < high[j] - _NUDGE:
            at = x.copy()
            at[j] = (near + far) / 2
            near, far = (near, at[j]) if _surprise(at, prepared, c)[0] - value > _DROP else (at[j], far)
        ends.append((low[j], far))
    return ends


def _logit(p: float) -> float:
    return float(np.log(p / (1.0 - p)))


def _expit(x: float) -> float:
    return float(1.0 / (1.0 + np.exp(-x)))
