"""The corrector `contact`: the most likely consistent goals, tested against the stated noise.

Every motion parameter is free; what the contacts do not ask for is not changed, since any change costs likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.compact import Compact, compact
from apo_bench.correction.consistency import LEVEL, consistency, slack, suspects
from apo_bench.correction.ending import refused, sentence
from apo_bench.correction.equations import Equations, equations, largest
from apo_bench.correction.manifold import Nearest, nearest
from apo_bench.correction.posterior import freedom, marginals, rank
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.program import Consistency, Correction, Iterate, Observation, Suspect

Doubt = Literal["apply", "warn", "refuse", "drop"]
DROPS = 3
"""Relations that `drop` leaves out at most."""


@final
@dataclass(frozen=True)
class ContactCorrector:
    """Nearest consistent goals; what to do if the test of the correction fails is said beforehand."""

    doubt: Doubt = "warn"
    """`apply` says nothing, `warn` names the suspects and goes on, `refuse` does not go on (status `doubtful`), and
    `drop` leaves the most suspect relation out, up to three in turn, until the test passes."""
    level: float = LEVEL
    """The test fails if the p-value is below: the share of false alarms."""

    def __post_init__(self) -> None:
        if self.doubt not in ("apply", "warn", "refuse", "drop"):
            raise InputError(f"doubt={self.doubt!r} was given; apply, warn, refuse or drop is allowed.")
        if not 0.0 < self.level < 1.0:
            raise InputError(f"a test level of {self.level!r} was given; a number between 0 and 1 is allowed.")

    def __call__(self, seen: Observation) -> Correction:
        """Correct an observation.

        Returns:
            `converged`, `not_seen`, `inconsistent` (the contacts contradict each other), `doubtful` (only of `refuse`),
            `not_converged` or `not_finite`; only the first is meant to be executed. `freed` are all operations that a
            contact depends on; `covariance` is the posterior.

        Raises:
            InputError: The covariance of an operation is not positive definite.
        """
        return self.given(seen, None)

    def given(self, seen: Observation, found: Nearest | None) -> Correction:
        """The same, if the observation has been solved already."""
        if not seen.seen.all():
            return refused(seen)
        L, system = scales(seen.covariance), equations(seen.assembly, seen.start, seen.goals)
        every = compact(system, len(seen.goals))
        fits = np.array([seen.assembly.is_fit(r.contact) for r in seen.assembly.relations()], dtype=np.bool_)
        now = _Attempt(seen, system, every, L, slack(fits, every, seen.play_m))
        kept, dropped = np.ones(len(every), dtype=np.bool_), tuple[str, ...]()
        found, tested = now.solve(kept, self.level, found)
        first = tested
        while self.doubt == "drop" and not tested.passes and found.finite and len(dropped) < DROPS:
            worst = now.suspects(kept)[:1]
            if not worst:
                break
            dropped += (worst[0].relation,)
            kept = now.without(dropped)
            found, tested = now.solve(kept, self.level)
        if self.doubt != "apply" and not first.passes and found.finite:
            first = replace(first, suspects=now.suspects(np.ones(len(every), dtype=np.bool_)))
        return self._report(now, found, kept, tested, first, dropped)

    def _report(
        self,
        now: _Attempt,
        found: Nearest,
        kept: NDArray[np.bool_],
        tested: Consistency,
        first: Consistency,
        dropped: tuple[str, ...],
    ) -> Correction:
        seen, system = now.seen, now.system
        known = freedom(found.Jt)
        directions = rank(found.Jt) if known is None else known.rank
        status = _status(found, largest(system.gaps(found.goals)[kept]), seen.gap_m)
        if status == "converged" and self.doubt in ("refuse", "drop") and not tested.passes:
            status = "doubtful"
        of = "every contact" if kept.all() else f"every contact but those of {', '.join(dropped)}"
        said = sentence(status, seen.gap_m, of) + ("" if self.doubt == "apply" else _doubts(first, dropped))
        return Correction(
            goals=found.goals,
            status=status,
            sentence=said,
            freed=system.variables(len(seen.goals)),
            gap_before_m=largest(system.residual(seen.goals)),
            gap_after_m=largest(system.residual(found.goals)),
            rank=directions,
            trace=tuple(Iterate(turn.gap_m, directions, turn.step) for turn in found.trace),
            test=first,
            covariance=marginals(found, known.free) if known is not None and status == "converged" else None,
            dropped=dropped,
        )


contact = ContactCorrector()
contact_apply = ContactCorrector("apply")
contact_refuse = ContactCorrector("refuse")
contact_drop = ContactCorrector("drop")


def scales(covariance: Array) -> Array:
    """L with L L^t = covariance, (n, 6, 6).

    Raises:
        InputError: One is not positive definite.
    """
    L = np.zeros(covariance.shape)
    for k, C in enumerate(covariance):
        try:
            L[k] = np.linalg.cholesky(C)
        except np.linalg.LinAlgError:
            L[k] = np.nan
        if not np.isfinite(L[k]).all():
            raise InputError(
                f"the covariance of operation {k + 1} is not positive definite; "
                "state finite numbers and a variance above zero in every direction."
            )
    return L


@final
@dataclass(frozen=True, eq=False)
class _Attempt:
    """One observation with its equations, to be solved with some of its contacts."""

    seen: Observation
    system: Equations
    every: Compact
    L: Array
    slack_m: Array

    def solve(self, kept: NDArray[np.bool_], level: float, found: Nearest | None = None) -> tuple[Nearest, Consistency]:
        part, slack_m = self.every.among(kept), self.slack_m[np.repeat(kept, 3)]
        found = nearest(part, self.seen.goals, self.L) if found is None else found
        return found, consistency(part, self.seen.goals, self.L, found, slack_m, level)

    def suspects(self, kept: NDArray[np.bool_]) -> tuple[Suspect, ...]:
        return suspects(self.seen.assembly, self.every, self.seen.goals, self.L, self.slack_m, kept)

    def without(self, dropped: tuple[str, ...]) -> NDArray[np.bool_]:
        kept = np.ones(len(self.every), dtype=np.bool_)
        for i, arc in enumerate(self.seen.assembly.arcs()):
            kept[list(arc)] = f"R{i + 1}" not in dropped
        return kept


def _status(found: Nearest, left_m: float, gap_m: float) -> str:
    if not found.finite:
        return "not_finite"
    if left_m <= gap_m:
        return "converged" if found.at_rest else "not_converged"
    return "inconsistent"


def _doubts(tested: Consistency, dropped: tuple[str, ...]) -> str:
    """What the test says, if it has something to say."""
    if tested.passes:
        return ""
    named = ", ".join(suspect.relation for suspect in tested.ambiguous) or "none alone"
    said = f"; the correction is longer than the stated noise explains (p = {tested.p_value:.2g}), suspected: {named}"
    return f"{said}; left out: {', '.join(dropped)}" if dropped else said
