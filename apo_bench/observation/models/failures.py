"""How cameras fail: some operations are seen where their part is not, with the covariance of a right pose.

What is false is drawn apart from the noise, so that a later look can repeat it: a model keeps no state.

Gross outliers and misses: some operations are seen quite wrongly, some not at all.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from math import inf
from typing import ClassVar, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, Poses, measured_rates, placements
from apo_bench.errors import require
from apo_bench.geometry import Array, approximate_symmetries, frozen, pose
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.isotropic import Facts, Level, observe_displaced

RATE = 0.3
"""Share of operations that are seen falsely."""
NEAREST_M = 0.02
FARTHEST_M = 0.06
"""An error along the ray."""
VIEW_SHIFT_M = 0.02
VIEW_TURN_RAD = float(np.radians(5.0))
"""Standard deviations of the displacement of a view, along and about each axis."""
_MOST_REPEAT = 0.999
"""A corrector is told no more than this, which no number of looks proves."""


class Failures(NamedTuple):
    """What is false in one look at n operations."""

    false: NDArray[np.bool_]
    """(n,)."""
    goals: Array
    """(n, 4, 4), where the parts seem to be before any noise, world frame, [m]; the true goals where nothing is."""


def _facts(title: str, formula: str, *notes: str) -> Facts:
    """Facts of a kind of failure."""
    return Facts(
        title=title,
        formula=(f"T_seen = S exp(L e), {formula} of a failure, else S = T",),
        frame="of the part that is seen, the same in every direction",
        parameters=(
            f"p = {RATE:g} if nothing else is stated: share of operations that fail",
            "r = 0 if nothing else is stated: probability that a later look repeats what was false in the first",
        ),
        states="L^2, the covariance of what is no failure, with p, r and where the camera stands",
        notes=(*notes, "At level 0 nothing fails; how far a failure is off does not depend on the level"),
    )


@dataclass(frozen=True, eq=False)
class CameraFailures(ABC):
    """Isotropic noise about poses some of which are false. At level 0 nothing is."""

    level: Level
    rate: float = RATE
    repeat: float = 0.0
    """Probability that a later look repeats what was false in the first one."""
    camera: Camera = field(default_factory=Camera)

    def __post_init__(self) -> None:
        for name, share in (("failures", self.rate), ("repeated failures", self.repeat)):
            require(0.0 <= share <= 1.0, f"a share of {name} of {share:g} was given; give a number from 0 to 1.")

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        return self._observed(assembly, demonstration, rng, self.failures(assembly, demonstration, rng))

    def again(
        self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator, first: np.random.Generator
    ) -> Observation:
        """A later look.

        Args:
            first: A fresh copy of the generator that the first observation was drawn from.
        """
        before = self.failures(assembly, demonstration, first)
        now = self.failures(assembly, demonstration, rng)
        repeated = before.false & (rng.random(len(assembly)) < self.repeat)
        goals = np.where(repeated[:, None, None], before.goals, now.goals)
        return self._observed(assembly, demonstration, rng, Failures(repeated | now.false, goals))

    def failures(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Failures:
        """What a first look has wrong: the first draws of `__call__`."""
        seeming = demonstration.goals.copy()
        if max(self.level) > 0.0 and len(assembly):
            seeming = self._seeming(assembly, demonstration, rng)
        return Failures(np.abs(seeming - demonstration.goals).max(axis=(1, 2), initial=0.0) > 0.0, seeming)

    @abstractmethod
    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        """The goals, (n, 4, 4), with those that are false replaced."""

    def _observed(
        self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator, failures: Failures
    ) -> Observation:
        sigma = self.level.sigma()
        xi = rng.standard_normal((len(assembly), 6)) * sigma
        seen = observe_displaced(assembly, replace(demonstration, goals=failures.goals), xi, np.diag(sigma**2))
        x, y, z = self.camera.T_world_camera[:3, 3].tolist()
        rates = replace(measured_rates(self.rate, 0.0), repeat=min(self.repeat, _MOST_REPEAT), camera_m=(x, y, z))
        return replace(seen, outliers=rates)

    def _drawn(self, n: int, rng: np.random.Generator) -> list[int]:
        """The operations that are false."""
        return [int(k) for k in np.flatnonzero(rng.random(n) < self.rate)]


@final
class Flipped(CameraFailures):
    """Parts are seen turned by one of their approximate symmetries, T F; one that has none is seen rightly."""

    FACTS: ClassVar[Facts] = _facts(
        "parts that nearly look the same after a turn are seen turned",
        "S = T F, F one of the turns after which the part nearly fills the same space",
        "A part without such a turn is seen rightly",
    )

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        for k in self._drawn(len(goals), rng):
            turns = approximate_symmetries(assembly.solids[assembly.operations[k].main]).turns
            if len(turns):
                goals[k] = goals[k] @ turns[rng.integers(len(turns))]
        return goals


@final
class Stale(CameraFailures):
    """Parts are seen where they were before the operation moved them."""

    FACTS: ClassVar[Facts] = _facts(
        "parts are seen where they were before they were moved", "S the pose of the part before the operation"
    )

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        before = (demonstration.start, *placements(assembly, demonstration.start, demonstration.goals))
        for k in self._drawn(len(goals), rng):
            goals[k] = before[k][assembly.operations[k].main]
        return goals


@final
class Swapped(CameraFailures):
    """The views of two operations on like parts are exchanged; where no two parts are alike, of any two."""

    FACTS: ClassVar[Facts] = _facts(
        "two parts are taken for each other",
        "S the pose of another operation, which has this one's",
        "Operations on like parts are exchanged, of any two parts where none are alike",
    )

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        parts = [operation.main for operation in assembly.operations]
        free = set(range(len(parts)))
        for k in range(len(parts)):
            # Both of a pair are false, so each operation starts one with half the rate.
            starts = rng.random() < self.rate / 2.0
            others = [i for i in sorted(free - {k}) if parts[i] != parts[k]]
            like = [i for i in others if assembly.solids[parts[i]] is assembly.solids[parts[k]]] or others
            if starts and k in free and like:
                i = like[int(rng.integers(len(like)))]
                goals[[k, i]] = demonstration.goals[[i, k]]
                free -= {i, k}
        return goals


@final
class AlongRay(CameraFailures):
    """Parts are seen 20 to 60 mm too near or too far, on the ray of the camera."""

    FACTS: ClassVar[Facts] = _facts(
        "parts are seen too near or too far",
        f"S = T shifted by {1e3 * NEAREST_M:g} to {1e3 * FARTHEST_M:g} mm towards the camera or away",
    )

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        rays = self.camera.rays(goals)
        for k in self._drawn(len(goals), rng):
            goals[k, :3, 3] += rays[k] * rng.choice((-1.0, 1.0)) * rng.uniform(NEAREST_M, FARTHEST_M)
        return goals


@final
class DisplacedView(CameraFailures):
    """Operations one after the other, as many as the rate says and two at least, share one displacement."""

    FACTS: ClassVar[Facts] = _facts(
        "operations in a row are displaced together",
        "S = P exp(c) P^-1 T, P the axes of the camera in the middle of them, one c",
        f"c: {1e3 * VIEW_SHIFT_M:g} mm and {np.degrees(VIEW_TURN_RAD):g} deg along and about each axis",
        "As many as p says, two at least",
    )

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        many = min(len(goals), max(2, round(self.rate * len(goals)))) if self.rate > 0.0 else 0
        first = int(rng.integers(len(goals) - many + 1))
        error = rng.standard_normal(6) * np.repeat([VIEW_SHIFT_M, VIEW_TURN_RAD], 3)
        # T -> P exp(e) P^-1 T, P the axes of the camera in the middle of what is displaced.
        view = slice(first, first + many)
        if many:
            P = self.camera.T_world_camera.copy()
            P[:3, 3] = goals[view, :3, 3].mean(axis=0)
            goals[view] = P @ pose.exp(error) @ pose.inverse(P) @ goals[view]
        return goals


OUTLIERS = 0.1
MISSES = 0.02
"""Share of operations that are seen quite wrongly, and that are not seen."""
OUTLIER_TIMES = 10.0
"""An outlier errs by so many times the level."""
UNSEEN_DEVIATION = frozen(np.repeat([0.5, np.pi / 2.0], 3), 6)
"""Standard deviation that is stated of what was not seen, [m, rad]."""


@final
@dataclass(frozen=True)
class Outliers:
    """Isotropic noise in which some errors are many times larger, unannounced, and some operations are missed.

    What is stated is the covariance of an error that is no outlier, as an estimator states it that does not know that
    it is wrong; `inflation` says how much larger the covariance of all errors is. Shares do not depend on the level:
    the same operations are outliers and missed at every level, but for level 0, at which everything is seen as shown.
    """

    level: Level
    outliers: float = OUTLIERS
    misses: float = MISSES
    times: float = OUTLIER_TIMES

    FACTS: ClassVar[Facts] = Facts(
        title="gross outliers that do not say so, and operations that are missed",
        formula=("T_seen = T exp(L e), or, of an outlier, T exp(m L e)", "of a miss: seen = false"),
        frame="of the part that is seen, the same in every direction",
        parameters=(
            f"p = {OUTLIERS:g}: share of outliers among what is seen",
            f"q = {MISSES:g}: share of misses",
            f"m = {OUTLIER_TIMES:g}: an outlier errs m times as much",
        ),
        states=(
            f"L^2, the covariance of what is no outlier; that of all errors is 1 + p (m^2 - 1) = "
            f"{1.0 + OUTLIERS * (OUTLIER_TIMES**2 - 1.0):g} times as large"
        ),
        notes=(
            f"A missed operation has the pose at which its part was seen last, or started, with "
            f"{UNSEEN_DEVIATION[0]:g} m and {np.degrees(UNSEEN_DEVIATION[3]):g} deg: most methods refuse it",
            "At level 0 nothing is missed",
        ),
    )

    def __post_init__(self) -> None:
        for name, share in (("outliers", self.outliers), ("misses", self.misses)):
            require(0.0 <= share <= 1.0, f"a share of {name} of {share:g} was given; give a number from 0 to 1.")
        require(
            1.0 <= self.times < inf, f"outliers {self.times:g} times as large were given; give a finite number from 1."
        )

    @property
    def inflation(self) -> float:
        """Covariance of the errors of all that is seen, over the one that is stated."""
        return 1.0 + self.outliers * (self.times**2 - 1.0)

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit = rng.standard_normal((len(assembly), 6))
        chance = rng.random((len(assembly), 2))
        times = np.where(chance[:, :1] < self.outliers, self.times, 1.0)
        seen = observe_displaced(assembly, demonstration, unit * times * sigma, np.diag(sigma**2))
        missed = (chance[:, 1] < self.misses) & (max(self.level) > 0.0)
        goals = seen.goals.copy()
        covariance = seen.covariance.copy()
        goals[missed] = last_seen(assembly, demonstration.start, goals, ~missed)[missed]
        covariance[missed] = np.diag(UNSEEN_DEVIATION**2)
        stated = measured_rates(0.0, self.outliers, self.times) if self.times > 1.0 else None
        return replace(seen, goals=goals, covariance=covariance, seen=~missed, outliers=stated)


def last_seen(assembly: Assembly, start: Poses, goals: Array, seen: NDArray[np.bool_]) -> Array:
    """Where the part of each operation was last seen, (n, 4, 4): at an operation that was seen, or at its start."""
    now = dict(start)
    out = goals.copy()
    for k, operation in enumerate(assembly.operations):
        if seen[k]:
            now[operation.main] = goals[k]
        out[k] = now.get(operation.main, np.eye(4))
    return out
