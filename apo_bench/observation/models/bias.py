"""Errors that stay: a model of a part has its origin in the wrong place, or the camera is not where it believes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.isotropic import observe_displaced
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
        formula=("T_seen_k = T_k exp(L e_part)",),
        frame="of the part: as if the origin of its model were in the wrong place",
        parameters=(),
        states="L^2 in every direction, over seeds; that the errors of one part are equal is not said, since an "
        "observation has no place for it",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        parts = sorted(assembly.solids)
        unit = dict(zip(parts, rng.standard_normal((len(parts), 6)), strict=True))
        xi = np.array([unit[operation.main] for operation in assembly.operations]).reshape(-1, 6) * sigma
        return observe_displaced(assembly, demonstration, xi, np.diag(sigma**2))


@final
@dataclass(frozen=True, eq=False)
class BiasView:
    """One displacement E of the world, drawn per trial, takes every part to where it is seen.

    What parts are to each other is seen without error, what they are to the fixed parts is not. E turns about the
    middle of the operations' goals, where its size is the level; about the camera, a degree would be 16 mm.
    The twist by which an operation is wrong, xi = Ad(T^-1 P) e with P the camera's axes in that middle, is the same
    computed from shown poses and from seen ones, so the covariance that is stated is exact and tells nothing.
    """

    level: Level
    camera: Camera = field(default_factory=Camera)

    FACTS: ClassVar[Facts] = Facts(
        title="one constant error of the view, common to all parts and operations",
        formula=("T_seen_k = P exp(L e) P^-1 T_k, the same e for all k",),
        frame="P with the axes of the camera, in the middle of all goals",
        parameters=(),
        states="Ad(T_k^-1 P) L^2 Ad(T_k^-1 P)^t, over seeds: parts far from the middle are less well placed; that the "
        "errors of all operations are one is not said, since an observation has no place for it",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit = rng.standard_normal(6)
        if not len(assembly):
            return observe_displaced(assembly, demonstration, np.zeros((0, 6)), np.diag(sigma**2))
        view = pose.adjoint(pose.inverse(demonstration.goals) @ self._middle(demonstration.goals))
        return observe_displaced(assembly, demonstration, view @ (unit * sigma), self._covariance(view, sigma))

    def _middle(self, goals: Array) -> Array:
        P = self.camera.T_world_camera.copy()
        P[:3, 3] = goals[:, :3, 3].mean(axis=0)
        return P

    @staticmethod
    def _covariance(view: Array, sigma: Array) -> Array:
        C = view @ np.diag(sigma**2) @ np.swapaxes(view, 1, 2)
        return np.asarray((C + np.swapaxes(C, 1, 2)) / 2)
