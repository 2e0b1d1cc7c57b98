"""Noise that drifts: what is wrong in one operation is nearly as wrong in the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Facts, Level

CORRELATION = 0.9
"""Between the errors of an operation and the next."""


@final
@dataclass(frozen=True, eq=False)
class Correlated:
    """Isotropic Gaussian noise whose errors follow a first-order autoregression from operation to operation.

    It drifts in the axes of the camera, whatever part is moved, as with a mount that warms up. After any number of
    operations its standard deviation is the level.
    """

    level: Level
    camera: Camera = field(default_factory=Camera)
    correlation: float = CORRELATION

    FACTS: ClassVar[Facts] = Facts(
        title="errors that drift: correlated from operation to operation",
        formula=("z_1 = e_1, z_k = rho z_(k-1) + sqrt(1 - rho^2) e_k", "T_seen_k = T_k exp(L A_k^t z_k)"),
        frame="the axes of the camera, into which A_k turns those of the part",
        parameters=(f"rho = {CORRELATION:g}: correlation of an operation's error with the next one's, 0 to 1",),
        states="L^2 in every direction for each operation, which is true; that they are correlated is not said, since "
        "an observation holds blocks of single operations only",
    )

    def __post_init__(self) -> None:
        if not 0.0 <= self.correlation <= 1.0:
            raise InputError(f"a correlation of {self.correlation:g} was given; give a number from 0 to 1.")

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit = rng.standard_normal((len(assembly), 6))
        for k in range(1, len(unit)):
            unit[k] = self.correlation * unit[k - 1] + np.sqrt(1.0 - self.correlation**2) * unit[k]
        place, turn = np.split((unit * sigma).reshape(-1, 2, 3) @ self.camera.T_world_camera[:3, :3].T, 2, axis=1)
        xi = np.zeros((len(assembly), 6))
        xi[:, 3:] = np.einsum("nji,nj->ni", demonstration.goals[:, :3, :3], turn[:, 0])
        R_seen = (demonstration.goals @ pose.exp(xi))[:, :3, :3]
        xi[:, :3] = np.einsum("nji,nj->ni", R_seen, place[:, 0])
        return observe_displaced(assembly, demonstration, xi, np.diag(sigma**2))
