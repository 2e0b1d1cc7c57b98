"""The shares of the draws in which a plan is right: its measures within limits, its faces covered."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, final

import numpy as np
from scipy.special import ndtr

from apo_bench.assembly import Assembly, Contact, Plan, Poses, compute_placements
from apo_bench.geometry import Array
from apo_bench.judging.finished_assembly import compute_least_overlaps
from apo_bench.planning.prediction.arm_move import ArmMove
from apo_bench.planning.prediction.measure import DrawnMeasure, Measure
from apo_bench.planning.prediction.plan_measures import measure_drawn_plans, measure_plan
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.contact_errors import ContactError, Judged, share_within

if TYPE_CHECKING:
    from apo_bench.simulation.scene.scene import Scene

SIDE_MM = 0.03
"""Standard deviation of what the measures neglect for faces onto which a part slides: contact stops the slide."""
_FALLEN = 0.05
"""Prior probability that a part stands as it should not be able to, in units of `ContactError.log_weight`."""
_SLACK_SHARE = 0.1
"""Standard deviation of what the overlaps neglect, as a share of the face."""
_FALLS = 0.02
"""Factor of the score for each part that would fall or lean."""
_LEVEL = 0.5
"""An insertion axis is level if its cosine with the vertical is smaller: weight does not help the insertion there."""
_WEIGHED = ("falls", "leans")
"""Kinds of measures of stability, which no draw changes."""
_UNKNOWN = 0.5
"""Share of overlaps if the faces meet in no drawn truth."""


@final
class PlanShares:
    """Shares of the draws in which one plan is right, if given contacts are the true ones."""

    def __init__(
        self, plan: Plan, where: Scene | Scenario, arm: Sequence[ArmMove], ends: Sequence[Poses], slack_mm: float
    ) -> None:
        """Prepare the shares of a plan.

        Args:
            arm: Motions of the arm.
            ends: Poses to which robots with drawn errors bring the parts; empty: as planned.
            slack_mm: Standard deviation of what the measures neglect.
        """
        scenario = where if isinstance(where, Scenario) else where.scenario
        self.plan = plan
        self.judged = Judged(scenario.attach, scenario.thresholds, where.clearance_mm, slack_mm)
        self._arm = arm
        self._ends = ends
        # |cosine| of each insertion axis with the vertical
        ways = [abs(float(T[2, :3] @ how.direction)) for how, T in zip(scenario.attach, plan.target_poses, strict=True)]
        # per operation, reduction of the judge's limit for insertion contacts, [mm]
        self._less_mm = [scenario.thresholds.fit_margin_mm if rise < _LEVEL else 0.0 for rise in ways]
        self._final = compute_placements(plan.assembly, plan.start, plan.target_poses)[-1]
        self._known = dict[Assembly, tuple[float, float]]()
        self.missing: Sequence[ContactError] | None = None
        """Contacts that may be missing; the weight of each is its odds against none. None: none is missing."""

    def fit(self, assembly: Assembly, standing: Assembly | None = None) -> float:
        """Probability that all measures of the plan are within their limits, mean over robots.

        Args:
            standing: The assembly with whose contacts parts stand; default: the same.
        """
        return self._fit(standing or assembly)[0] * self._fit(assembly)[1]

    def fit_or_missing(self, assembly: Assembly, standing: Assembly | None = None) -> float:
        """The share of `fit`, as a mean over no missing contact and each that may be missing.

        Args:
            standing: As of `fit`.
        """
        fit = self.fit(assembly, standing) * (_FALLS if self._hovers(standing or assembly) else 1.0)
        falls = self.falls(standing or assembly)
        # A part that would fall stood in the demonstration, so that nothing is missing is less likely.
        total = _FALLEN if falls else 1.0
        right = total * fit
        for each in self.missing or ():
            odds = math.exp(each.log_weight)
            total += odds
            right += odds * each.accepted * (self.fit(_add_contact(assembly, each)) if falls else fit)
        return right / total

    def falls(self, assembly: Assembly) -> bool:
        """Whether a part of the plan would fall or lean, or nothing carries it."""
        return self._fit(assembly)[0] < 1.0 or self._hovers(assembly)

    def _hovers(self, assembly: Assembly) -> bool:
        """Whether an operation makes no contact, although contacts may be missing: then nothing carries its part."""
        return self.missing is not None and not all(operation.contacts for operation in assembly.operations)

    def _fit(self, assembly: Assembly) -> tuple[float, float]:
        """(stands, others): `_FALLS` for each part that would fall or lean, and the share of the other measures."""
        if assembly not in self._known:
            judged = self.judged
            plan = self.plan if assembly is self.plan.assembly else replace(self.plan, assembly=assembly)
            lengths = judged.clearance_mm, judged.thresholds, judged.attach
            planned = list(measure_plan(plan, *lengths, arm=self._arm))
            stands = math.prod(_FALLS for each in planned if each.kind in _WEIGHED and each.exceeded)
            others: Iterable[Measure | DrawnMeasure] = (each for each in planned if each.kind not in _WEIGHED)
            if self._ends:
                others = measure_drawn_plans(plan, *lengths, self._arm, self._ends)
            # What is neglected is the same for all measures, so the worst one decides.
            worst = np.array([self._within(each) for each in others]).min(axis=0, initial=1.0)
            self._known[assembly] = stands, float(worst.mean())
        return self._known[assembly]

    def _within(self, measure: Measure | DrawnMeasure) -> Array:
        """Probability that one measure is within its limit, (), or (r,) for r draws."""
        less_mm = self._less_mm[measure.operation] if measure.kind in ("fit", "tip") else 0.0
        room_mm = measure.allowed - less_mm - measure.size
        if measure.kind == "side":
            return np.asarray(ndtr(room_mm / SIDE_MM))
        return share_within(room_mm, self.judged.slack_mm)

    def cover(self, assembly: Assembly, truths: Array) -> float:
        """Probability that faces overlap as the judge requires, if the plan is executed exactly; mean over truths.

        Args:
            assembly: With the contacts that count.
            truths: (count, n, 4, 4), possible true poses.
        """
        overlaps = compute_least_overlaps(assembly, self._final, truths)
        possible = overlaps[np.isfinite(overlaps)]  # without truths in which faces do not meet
        if not len(possible):
            return _UNKNOWN
        return float(np.mean(ndtr((possible - self.judged.thresholds.overlap_fraction) / _SLACK_SHARE)))


def _add_contact(assembly: Assembly, error: ContactError) -> Assembly:
    """The assembly with the contact of an error in addition."""
    return exchange_contacts(assembly, error.made, lambda contacts: (*contacts, error.contact))


def exchange_contacts(
    assembly: Assembly, k: int, change: Callable[[tuple[Contact, ...]], tuple[Contact, ...]]
) -> Assembly:
    """The assembly with other contacts of operation k."""
    operations = list(assembly.operations)
    operations[k] = replace(operations[k], contacts=change(operations[k].contacts))
    return replace(assembly, operations=tuple(operations))
