"""How cameras fail: some operations are seen where their part is not, with the covariance of a right pose.

What is false is drawn apart from the noise, so that a later look can repeat it: a model keeps no state.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, measured_rates, placements
from apo_bench.errors import require
from apo_bench.geometry import Array, approximate_symmetries, pose
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
        seeming = replace(demonstration, goals=failures.goals)
        seen = observe_displaced(assembly, seeming, xi, np.diag(sigma**2))
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
