"""Noise of a camera that stands somewhere: worse along the ray to each part than across it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.observation.models.anisotropic import ACROSS, ALONG, IN_IMAGE, OUT_OF_IMAGE
from apo_bench.observation.models.camera import AZIMUTH_DEG, DISTANCE_M, ELEVATION_DEG, WORKSPACE_MIDDLE_M, Camera
from apo_bench.observation.models.facts import Facts
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Level


@final
@dataclass(frozen=True, eq=False)
class Sighted:
    """Every part errs about its own ray: along it, across it, about it, and by tilting towards it.

    The factors on the level are those of `anisotropic`, which is this seen from infinitely far away: there all rays are
    parallel, while those of a camera 0.9 m away to parts half a metre apart differ by some 30 degrees.
    """

    level: Level
    camera: Camera = field(default_factory=Camera)
    across: float = ACROSS
    along: float = ALONG
    tilt: float = OUT_OF_IMAGE
    about: float = IN_IMAGE

    FACTS: ClassVar[Facts] = Facts(
        title="a camera with a place: errors along, across and about the ray to each part",
        formula=(
            "T_seen = T exp(xi), xi = (R_seen^t F d, R^t F w)",
            f"d = L ({ACROSS:g} e1, {ACROSS:g} e2, {ALONG:g} e3), w = L ({OUT_OF_IMAGE:.3g} e4, "
            f"{OUT_OF_IMAGE:.3g} e5, {IN_IMAGE:g} e6)",
        ),
        frame="F of the ray from the camera to the origin of the part: the axes of the camera (OpenCV), turned the "
        "shortest way until z is the ray",
        parameters=(
            f"camera = {DISTANCE_M:g} m from ({', '.join(f'{x:g}' for x in WORKSPACE_MIDDLE_M)}) m in the world, at "
            f"which it looks, {ELEVATION_DEG:g} deg above the table and {AZIMUTH_DEG:g} deg from the x axis",
            f"across = {ACROSS:g}, along = {ALONG:g}: of the position over the level, per axis",
            f"tilt = {OUT_OF_IMAGE:.3g}, about = {IN_IMAGE:g}: of the turn over the level, per axis out of the image, "
            "and in it",
        ),
        states="the covariance in the frame of the ray on which the part is seen, turned into the part; it differs "
        "from the one drawn by the angle between the two rays, a thousandth at 1 mm",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        mm, rad = self.level.mm * 1e-3, np.radians(self.level.deg)
        sigma = np.array([mm * self.across] * 2 + [mm * self.along] + [rad * self.tilt] * 2 + [rad * self.about])
        xi = self.camera.twists(demonstration.goals, rng.standard_normal((len(assembly), 6)) * sigma)
        seen = observe_displaced(assembly, demonstration, xi, np.zeros((6, 6)))
        return observe_displaced(assembly, demonstration, xi, self.camera.covariance(seen.goals, np.diag(sigma**2)))
