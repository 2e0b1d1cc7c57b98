"""Result of a corrector: poses, how the solver ended, and the chi-square test of the correction."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple, Protocol, final, runtime_checkable

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly.observation import Observation
from apo_bench.assembly.plan import Plan, Step
from apo_bench.assembly.topology import Contact
from apo_bench.errors import require
from apo_bench.geometry import Array, freeze, make_copyable


class Iterate(NamedTuple):
    """One iteration of a solver, for reports and plots."""

    gap_m: float
    """Largest |e| before the step, [m]. For `contact` and `contact-robust` it is that of the compact equations, three
    per contact, which count sqrt(v) times at the centre of v vertices. So it may exceed `Correction.gap_before_m`,
    the largest |e| of vertices."""
    rank: int
    """For the paper's solver, the rank of the equations at this iteration; for `contact`, the rank at the end, in every
    one."""
    step: float
    """For the paper's solver, the length of the scaled step, [m]; for `contact`, its largest component, in standard
    deviations."""


class FreeingTrial(NamedTuple):
    """One trial of the iterative correction of the paper (its Section 4.2): a solution with some poses free."""

    step: int
    """The operation that had just been observed, counted from 0."""
    free: tuple[int, ...]
    """The operations whose motion parameters were free, most recent first, counted from 0."""
    gap_m: float
    """Largest |e| over the equations of the trial, after solving."""


class Suspect(NamedTuple):
    """A relation, and the test of the correction without it."""

    relation: str
    """R1, R2, ... as in the relation graph: all contacts of one operation between one pair of parts. Or one of its
    contacts."""
    contacts: tuple[Contact, ...]
    made: int
    """The operation that made it, counted from 0."""
    chi_square: float
    """Squared Mahalanobis length of the correction when its equations are left out."""
    freedom: int
    """Rank of the remaining equations."""
    p_value: float


@final
@dataclass(frozen=True)
class Consistency:
    """The chi-square test of a correction: whether the stated noise explains its length."""

    chi_square: float
    """Squared Mahalanobis length of the correction, plus the residuals of contradictory contacts."""
    freedom: int
    """Degrees of freedom of the chi-square distribution: the rank of the contact equations at the solution. That is the
    number of directions that contacts fix, not the number they leave free."""
    p_value: float
    level: float
    """The test fails if the p-value is below this."""
    suspects: tuple[Suspect, ...] = ()
    """Every relation, the most suspect first; computed only if the test fails."""

    @property
    def passes(self) -> bool:
        """Whether the stated noise explains the correction."""
        return self.p_value >= self.level

    @property
    def ambiguous(self) -> tuple[Suspect, ...]:
        """The ambiguity set: relations without any one of which the test would pass."""
        return tuple(suspect for suspect in self.suspects if suspect.p_value >= self.level)


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One explanation of the observation: what is assumed of it, its probability, and the poses that follow."""

    weight: float
    """Probability; the weights of a correction leave to 1 the probability that none of its hypotheses is right."""
    poses: Array
    """(n, 4, 4), world frame, [m]."""
    covariance: Array | None
    """(n, 6, 6), posterior, of the body twist of the error of each pose, [m, rad]; None if unknown."""
    assumed: Observation
    """The assumed observation, of which the poses are the correction."""
    left_out: tuple[int, ...] = ()
    """Operations whose observations are all rejected, counted from 0."""
    dropped: tuple[str, ...] = ()
    """Relations that are rejected."""
    sentence: str = ""
    """How the assumptions differ from what was stated, in words; empty if they do not."""
    noise_scale: float = 1.0
    """Assumed ratio of the actual noise to the stated noise; `covariance` and `assumed` include it."""

    def __post_init__(self) -> None:
        freeze(self, poses=(None, 4, 4), covariance=(len(self.poses), 6, 6))


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Correction:
    """What a corrector returns for an observation of n operations.

    A corrector of your own may return the poses alone: `correct` and `evaluate` wrap them.
    """

    poses: Array
    """(n, 4, 4): the corrected pose of the main part after each operation, world frame, [m]."""
    status: str
    """`converged`, or one of the endings in `apo_bench.records.outcomes`."""
    sentence: str
    """The status in words."""
    freed: tuple[int, ...]
    """Operations whose motion parameters were free, counted from 0, most recent first."""
    gap_before_m: float
    """Largest contact error |e| of a vertex, or largest violation of an inequality, at the observed poses, [m]."""
    gap_after_m: float
    """The same at the corrected poses, [m]."""
    rank: int
    """Number of directions that the contact equations determine at the corrected poses."""
    trace: tuple[Iterate, ...] = ()
    """The iterations of the solver."""
    tried: tuple[FreeingTrial, ...] = ()
    """Every set of motion parameters that the iterative correction of the paper tried, in order."""
    schedule: tuple[Step, ...] = ()
    """Operations to do and undo, in order. Default: every operation once."""
    step_poses: Array | None = None
    """(steps, 4, 4), world frame, [m], as in `Plan`; None: those of `poses`."""
    test: Consistency | None = None
    """The chi-square test: does the stated noise explain the correction? None for correctors without it."""
    test_after: Consistency | None = None
    """The test without the dropped contacts; None if none was dropped."""
    covariance: Array | None = None
    """(n, 6, 6): posterior covariance of each pose, as a twist in the frame of the part, [m, rad]; None if unknown.
    Inequalities are not counted, so with them it is an upper bound. Of several hypotheses it is that of the first and
    of those with nearly the same poses."""
    dropped: tuple[str, ...] = ()
    """Relations or single contacts that the corrector dropped: `R3: stick.py on castle1.spy`."""
    left_out: tuple[int, ...] = ()
    """Operations whose observations are all rejected, counted from 0: their poses are inferred."""
    assumed: Observation | None = None
    """The observation that was corrected: without outliers, with reobservations. None: the one that was given."""
    hypotheses: tuple[Hypothesis, ...] = ()
    """Explanations of the observation, the most probable first; empty for correctors that consider one only."""
    noise_scale: float = 1.0
    """Estimated ratio of the actual noise to the stated noise; `covariance` and `assumed` include it."""

    def __post_init__(self) -> None:
        n = len(self.poses)
        freeze(self, poses=(n, 4, 4), covariance=(n, 6, 6), step_poses=(len(self.schedule), 4, 4))

    @property
    def ok(self) -> bool:
        """Whether the correction converged and may be executed."""
        return self.status == "converged"

    @check_arguments
    def plan(self, observation: Observation) -> Plan:
        """Return the plan with the corrected poses as targets.

        Args:
            observation: The observation that was corrected.

        Raises:
            InputError: The correction did not converge, so its poses must not be executed.
        """
        require(
            self.ok,
            f"the correction ended as {self.status} ({self.sentence}), which no robot should carry out; look at "
            "`correction.ok` first.",
        )
        step_poses = np.zeros((0, 4, 4)) if self.step_poses is None else self.step_poses
        return Plan(observation.assembly, observation.start, self.poses, self.schedule, step_poses)


@runtime_checkable
class Reobserver(Protocol):
    """Callable that observes operations, counted from 0, again; correctors may be given one.

    Each observation has its own errors, with the noise of the first, so it may be an outlier or a miss as well.
    """

    @property
    def left(self) -> int:
        """Number of observations that are left."""

    def __call__(self, operations: Collection[int]) -> Observation:
        """Observe some operations once; all others are not `observed`.

        Raises:
            InputError: No observation is left, or there is no such operation.
        """


@runtime_checkable
class ReobservingCorrector(Protocol):
    """A corrector that can request further observations; correctors without its method never get a reobserver."""

    def __call__(self, observation: Observation) -> Correction:
        """Correct an observation without further observations."""

    def correct_and_reobserve(self, observation: Observation, reobserve: Reobserver) -> Correction:
        """Correct an observation, observing operations again as often as needed and allowed."""
