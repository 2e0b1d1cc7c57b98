"""Noise of symmetric parts: rotations about their symmetry axes are less certain."""

from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.geometry import (
    Array,
    Solid,
    count_folds,
    find_direction_across,
    find_nearest_symmetric_pose,
    find_revolution,
    find_symmetries,
    make_rotation_about_axis,
    pose,
)
from apo_bench.perception.observation.models.displacement import observe_displaced
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel

FACTOR = 3.0
"""Factor on the level for rotations about an axis with high symmetry."""
_CONTINUOUS = 3.0
"""An axis has high symmetry if a part looks the same at least this often in a full turn."""


@final
@dataclass(frozen=True)
class SymmetricNoise:
    """Isotropic noise about the centre of volume, with larger rotations about axes of symmetry.

    About an axis of fourfold symmetry the second moments of a part are those of a body of revolution. Only its edges
    show its rotation, so the standard deviation is `FACTOR` times the level.

    Of the equivalent poses of a symmetric part, the one nearest to the truth is reported, since contacts name faces and
    so distinguish equal sides. A rotation error is thus at most half the angle between two equivalent poses.
    """

    noise_level: NoiseLevel

    FACTS: ClassVar[Facts] = Facts(
        title="turns about axes of symmetry are less certain; of equal poses the nearest is reported",
        formula=(
            "T_obs = T C exp(xi) C^-1 g, C the shift to the centre of volume",
            f"xi = L (e1, e2, e3, s1 e4, s2 e5, s3 e6), s_i = {FACTOR:g} about axes of fourfold symmetry, else 1",
            "g the one of the part's symmetries with which T_obs is turned the least",
        ),
        frame="of the observed part, about its centre of volume",
        parameters=(
            f"s = {FACTOR:g}: factor on turns about axes with {_CONTINUOUS:g} or more equal places a turn",
            "symmetries: proper rotations, computed from the boxes of each part (stick 8, castle 2, block 24)",
        ),
        states="the covariance of xi about the part's origin, where the standard deviation of a turn about an axis "
        "with m equal places counts as 180 / m / sqrt(3) deg at most; exact while errors are small against 180 / m deg "
        "(up to level 4), above an upper bound",
        notes=(
            "a part of revolution is the same after any turn about its axis; it is reported with the usual error",
            "`apo_bench.perception.observation.models.symmetric_parts:AnyTurnNoise` reports any equal pose instead, "
            "each as likely, also at level 0; a contact that names a face then concerns another side",
        ),
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        unit = rng.standard_normal((len(assembly), 6))
        xi = np.zeros((len(assembly), 6))
        covariance = np.zeros((len(assembly), 6, 6))
        groups = {part: find_symmetries(assembly.solids[part]) for part in {o.main for o in assembly.operations}}
        for k, operation in enumerate(assembly.operations):
            solid = assembly.solids[operation.main]
            group = groups[operation.main]
            frame, fold = _find_principal_frame(solid, group)
            about = pose.adjoint(frame)
            sigma, stated = self._deviations(fold)
            if np.any(unit[k] * sigma):
                # About the centre of volume: the body twist there is Ad(frame) xi at the part's origin.
                xi[k] = pose.log(find_nearest_symmetric_pose(pose.exp(about @ (unit[k] * sigma)), group, np.eye(3)))
            covariance[k] = about @ np.diag(stated**2) @ about.T
        return observe_displaced(assembly, demonstration, xi, (covariance + np.swapaxes(covariance, 1, 2)) / 2)

    def _deviations(self, fold: Array) -> tuple[Array, Array]:
        """Standard deviations that are drawn, and those that are stated, (6,) each, [m, rad].

        Both are about the centre of volume; `fold` (3,) is the order of symmetry about each axis.
        """
        turn = np.radians(self.noise_level.deg) * np.where(fold >= _CONTINUOUS, FACTOR, 1.0)
        place = np.full(3, self.noise_level.mm * 1e-3)
        # Reported rotations are at most pi / fold; a uniform distribution over that range has this deviation.
        apart = np.where(np.isinf(fold), np.inf, np.pi / fold / np.sqrt(3.0))
        return np.append(place, turn), np.append(place, np.minimum(turn, apart))


def _find_principal_frame(solid: Solid, group: Array) -> tuple[Array, Array]:
    """The principal frame of a solid, and the order of its symmetry about each axis of that frame.

    Args:
        group: (m, 4, 4), symmetries of the solid.

    Returns:
        (4, 4), origin at the centre of volume, z along an axis of revolution if there is one, [m]; and (3,), how often
        the solid looks the same in a full turn, infinite about an axis of revolution.
    """
    frame = pose.at(solid.centroid)
    body = find_revolution(solid)
    if body is None:
        return frame, count_folds(group)
    x = find_direction_across(body.axis)
    frame = np.array(frame)
    frame[:3, :3] = np.column_stack([x, np.cross(body.axis, x), body.axis])
    return frame, np.array([len(group), len(group), np.inf])


@final
@dataclass(frozen=True)
class AnyTurnNoise:
    """Noise as `symmetric` that reports one of the equivalent poses of a part at random, also at level 0.

    The covariance is that of the error from the equivalent true pose nearest to the reported one.
    """

    noise_level: NoiseLevel

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        seen = SymmetricNoise(self.noise_level)(assembly, demonstration, rng)
        g = np.array([self._draw_symmetry(assembly.solids[o.main], rng) for o in assembly.operations]).reshape(-1, 4, 4)
        Ad = pose.adjoint(pose.inverse(g))
        C = Ad @ seen.covariance @ np.swapaxes(Ad, 1, 2)
        return replace(seen, poses=seen.poses @ g, covariance=(C + np.swapaxes(C, 1, 2)) / 2)

    @staticmethod
    def _draw_symmetry(solid: Solid, rng: np.random.Generator) -> Array:
        """Draw one symmetry (4, 4) of a solid; about an axis of revolution by a uniform angle."""
        group = find_symmetries(solid)
        body = find_revolution(solid)
        turn = np.asarray(group[rng.integers(len(group))])
        return (
            turn if body is None else make_rotation_about_axis(body.point, body.axis, rng.uniform(-np.pi, np.pi)) @ turn
        )
