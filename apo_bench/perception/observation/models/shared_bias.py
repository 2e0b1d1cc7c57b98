"""Noise with errors that several operations share: a bias of a part model, of the camera pose, or drift."""

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, SharedError, correlate_first_order
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import observe_displaced, observe_shared
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel

OWN = 1.0 / 20.0
"""Standard deviation of the independent error of each operation, relative to the level."""
OWN_FACT = f"o = {OWN:g}: independent error of each operation over the level"
CORRELATION = 0.9
"""Correlation between the errors of consecutive operations."""


@final
@dataclass(frozen=True)
class BiasNoise:
    """Noise with one constant error (body twist) per part, drawn per trial, in every operation that moves the part.

    Its mean is zero over seeds, but not over the operations of a trial. A correction that assumes independent errors
    of a part in two operations is overconfident.
    """

    noise_level: NoiseLevel

    FACTS: ClassVar[Facts] = Facts(
        title="one constant error per part, the same in every operation that moves it",
        formula=("T_obs_k = T_k exp(L e_part + o L e_k)",),
        frame="of the part: as if the origin of its model were in the wrong place",
        parameters=(OWN_FACT,),
        states="(1 + o^2) L^2 in every direction, of which operations of one part share L^2",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.noise_level.sigma()
        parts = sorted(assembly.solids)
        unit = dict(zip(parts, rng.standard_normal((len(parts), 6)), strict=True))
        own = rng.standard_normal((len(assembly), 6)) * OWN * sigma
        mains = [operation.main for operation in assembly.operations]
        xi = np.array([unit[main] for main in mains]).reshape(-1, 6) * sigma

        def shared(poses: Array) -> list[SharedError]:
            rows = {main: tuple(k for k, other in enumerate(mains) if other == main) for main in mains}
            return [SharedError(main, k, np.diag(sigma**2)) for main, k in rows.items()]

        return observe_shared(assembly, demonstration, xi + own, OWN * sigma, shared)


@final
@dataclass(frozen=True, eq=False)
class ViewBiasNoise:
    """Noise with one common displacement of all poses, drawn per trial, plus a small independent error.

    Poses of moved parts relative to each other are nearly exact, those relative to fixed parts are not. The rotation
    is about the middle of the operations' poses, where the size is the level; about the camera, a degree would be
    16 mm. The error of an operation is xi = Ad(T^-1 P) e, with P the camera's axes in that middle. It is the same if
    computed from observed poses. The stated covariance is about the middle of the observed poses, so it contains
    nothing of the truth; e has the same distribution there.
    """

    noise_level: NoiseLevel
    camera: Camera = field(default_factory=Camera)

    FACTS: ClassVar[Facts] = Facts(
        title="one constant error of the view, common to all parts and operations",
        formula=("T_obs_k = T_k exp(Ad(T_k^-1 P) L e + o L e_k), the same e for all k",),
        frame="P with the axes of the camera, in the middle of all poses",
        parameters=(OWN_FACT,),
        states="Ad(T_k^-1 P) L^2 Ad(T_k^-1 P)^t + o^2 L^2, of which operations share the first term",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.noise_level.sigma()
        unit = rng.standard_normal(6)
        own = rng.standard_normal((len(assembly), 6)) * OWN * sigma
        if not len(assembly):
            return observe_displaced(assembly, demonstration, np.zeros((0, 6)), np.diag(sigma**2))
        view = pose.adjoint(pose.inverse(demonstration.poses) @ _view_frame(self.camera, demonstration.poses))

        def shared(poses: Array) -> list[SharedError]:
            every = tuple(range(len(poses)))
            return [SharedError("camera", every, np.diag(sigma**2), _view_frame(self.camera, poses))]

        return observe_shared(assembly, demonstration, view @ (unit * sigma) + own, OWN * sigma, shared)


@final
@dataclass(frozen=True, eq=False)
class CorrelatedNoise:
    """Isotropic Gaussian noise whose errors follow a first-order autoregression from operation to operation.

    The errors drift in the axes of the camera, regardless of the part, as with a mount that warms up. Their standard
    deviation is the level in every operation.
    """

    noise_level: NoiseLevel
    camera: Camera = field(default_factory=Camera)
    correlation: float = CORRELATION

    FACTS: ClassVar[Facts] = Facts(
        title="errors that drift: correlated from operation to operation",
        formula=("z_1 = e_1, z_k = rho z_(k-1) + sqrt(1 - rho^2) e_k", "T_obs_k = T_k exp(L A_k^t z_k + o L e_k)"),
        frame="the axes of the camera, into which A_k turns those of the part",
        parameters=(f"rho = {CORRELATION:g}: correlation of the errors of an operation and the next", OWN_FACT),
        states="(1 + o^2) L^2 in every direction and the correlation of operations, both exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.noise_level.sigma()
        unit, own = rng.standard_normal((2, len(assembly), 6))
        for k in range(1, len(unit)):
            unit[k] = self.correlation * unit[k - 1] + np.sqrt(1.0 - self.correlation**2) * unit[k]
        # From the axes of the camera into those of the part: the rotation by R^t, the shift by the observed R^t.
        in_world = ((unit + OWN * own) * sigma).reshape(-1, 2, 3) @ self.camera.T_world_camera[:3, :3].T
        xi = np.zeros((len(assembly), 6))
        xi[:, 3:] = np.einsum("nji,nj->ni", demonstration.poses[:, :3, :3], in_world[:, 1])
        R_obs = (demonstration.poses @ pose.exp(xi))[:, :3, :3]
        xi[:, :3] = np.einsum("nji,nj->ni", R_obs, in_world[:, 0])

        def shared(poses: Array) -> list[SharedError]:
            every = tuple(range(len(assembly)))
            between = correlate_first_order(len(every), self.correlation)
            T = self.camera.T_world_camera
            return [SharedError("drift", every, np.diag(sigma**2), T, local=True, correlation=between)]

        return observe_shared(assembly, demonstration, xi, OWN * sigma, shared)


def _view_frame(camera: Camera, poses: Array) -> Array:
    """Return the axes of a camera in the middle of poses (n, 4, 4), as (4, 4), world, [m]."""
    P = camera.T_world_camera.copy()
    P[:3, 3] = poses[:, :3, 3].mean(axis=0)
    return P
