"""Errors that stay: a model of a part has its origin in the wrong place, or the camera is not where it believes."""

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.shared_error import SharedError
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.fitted import view_error, view_frame
from apo_bench.observation.models.isotropic import OWN, OWN_FACT, observe_displaced, observe_shared
from apo_bench.observation.models.level import Facts, Level


@final
@dataclass(frozen=True)
class Bias:
    """Every part has one body twist, drawn per trial, by which it is wrong in every operation that moves it.

    Zero on average over seeds, not over the operations of a trial. Corrections that take the errors of a part in two
    operations for independent ones are told too much.
    """

    level: Level

    FACTS: ClassVar[Facts] = Facts(
        title="one constant error per part, the same in every operation that moves it",
        formula=("T_seen_k = T_k exp(L e_part + o L e_k)",),
        frame="of the part: as if the origin of its model were in the wrong place",
        parameters=(OWN_FACT,),
        states="(1 + o^2) L^2 in every direction, over seeds, and that operations share L^2 of it, one error per part",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        parts = sorted(assembly.solids)
        unit = dict(zip(parts, rng.standard_normal((len(parts), 6)), strict=True))
        own = rng.standard_normal((len(assembly), 6)) * OWN * sigma
        mains = [operation.main for operation in assembly.operations]
        xi = np.array([unit[main] for main in mains]).reshape(-1, 6) * sigma

        def shared(goals: Array) -> list[SharedError]:
            rows = {main: tuple(k for k, other in enumerate(mains) if other == main) for main in mains}
            return [SharedError(main, k, np.diag(sigma**2)) for main, k in rows.items()]

        return observe_shared(assembly, demonstration, xi + own, OWN * sigma, shared)


@final
@dataclass(frozen=True, eq=False)
class BiasView:
    """One displacement E of the world, drawn per trial, takes every part to where it is seen, but for a small part.

    What parts are to each other is seen almost without error, what they are to the fixed parts is not. E turns about
    the middle of the operations' goals, where its size is the level; about the camera, a degree would be 16 mm.
    The twist by which an operation is wrong, xi = Ad(T^-1 P) e with P the camera's axes in that middle, is the same
    computed from shown poses and from seen ones. What is stated is about the middle of what was seen, so that nothing
    of the truth is in it; seen from there, e has the same distribution.
    """

    level: Level
    camera: Camera = field(default_factory=Camera)

    FACTS: ClassVar[Facts] = Facts(
        title="one constant error of the view, common to all parts and operations",
        formula=("T_seen_k = T_k exp(Ad(T_k^-1 P) L e + o L e_k), the same e for all k",),
        frame="P with the axes of the camera, in the middle of all goals",
        parameters=(OWN_FACT,),
        states="Ad(T_k^-1 P) L^2 Ad(T_k^-1 P)^t + o^2 L^2, over seeds, and that operations share the first: parts far "
        "from the middle are less well placed",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit = rng.standard_normal(6)
        own = rng.standard_normal((len(assembly), 6)) * OWN * sigma
        if not len(assembly):
            return observe_displaced(assembly, demonstration, np.zeros((0, 6)), np.diag(sigma**2))
        view = pose.adjoint(pose.inverse(demonstration.goals) @ view_frame(self.camera, [demonstration.goals]))

        def shared(goals: Array) -> list[SharedError]:
            return [view_error(self.camera, goals, sigma)]

        return observe_shared(assembly, demonstration, view @ (unit * sigma) + own, OWN * sigma, shared)
