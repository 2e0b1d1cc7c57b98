"""Noise that drifts: what is wrong in one operation is nearly as wrong in the next."""

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.shared_error import SharedError, first_order
from apo_bench.assembly.topology import Assembly
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.isotropic import OWN, OWN_FACT, observe_shared
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
        formula=("z_1 = e_1, z_k = rho z_(k-1) + sqrt(1 - rho^2) e_k", "T_seen_k = T_k exp(L A_k^t z_k + o L e_k)"),
        frame="the axes of the camera, into which A_k turns those of the part",
        parameters=(f"rho = {CORRELATION:g}: correlation of the errors of an operation and the next", OWN_FACT),
        states="(1 + o^2) L^2 in every direction for each operation, and how operations are correlated; both are exact",
    )

    def __post_init__(self) -> None:
        if not 0.0 <= self.correlation <= 1.0:
            raise InputError(f"a correlation of {self.correlation:g} was given; give a number from 0 to 1.")

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit, own = rng.standard_normal((2, len(assembly), 6))
        for k in range(1, len(unit)):
            unit[k] = self.correlation * unit[k - 1] + np.sqrt(1.0 - self.correlation**2) * unit[k]
        place, turn = np.split(
            ((unit + OWN * own) * sigma).reshape(-1, 2, 3) @ self.camera.T_world_camera[:3, :3].T, 2, axis=1
        )
        xi = np.zeros((len(assembly), 6))
        xi[:, 3:] = np.einsum("nji,nj->ni", demonstration.goals[:, :3, :3], turn[:, 0])
        R_seen = (demonstration.goals @ pose.exp(xi))[:, :3, :3]
        xi[:, :3] = np.einsum("nji,nj->ni", R_seen, place[:, 0])

        def shared(goals: Array) -> list[SharedError]:
            every = tuple(range(len(assembly)))
            between = first_order(len(every), self.correlation)
            camera = self.camera.T_world_camera
            return [SharedError("drift", every, np.diag(sigma**2), camera, local=True, correlation=between)]

        return observe_shared(assembly, demonstration, xi, OWN * sigma, shared)
