"""The range finder as a pose source: turns range images of a demonstration into an observation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.geometry import Array, copy_frozen
from apo_bench.perception.depth_camera.operation_detection import DetectedOperation, SensorPriors, follow_demonstration
from apo_bench.perception.depth_camera.range_finder import RangeImage, simulate_range_image
from apo_bench.perception.depth_camera.ray_caster import MakeRayCaster
from apo_bench.perception.observation.models import floor_covariance

_UNSEEN = copy_frozen(np.diag(np.repeat([0.1, 1.0], 3) ** 2), 6, 6)
"""The stated covariance of an operation that was not observed, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class RangeSensor:
    """A pose source with the signature of a noise model, `(assembly, shown, rng) -> Observation`.

    It fits poses to range images. Of the demonstration it uses only the topology, the start poses and the covariance of
    the human error. For a symmetric part it reports the equivalent pose nearest to the planned rotation; it takes
    nothing else from the plan.
    """

    images: tuple[RangeImage, ...]
    """Range images without errors: before the demonstration, then one per pause of the hand."""
    level_m: float
    """Standard deviation of one ray."""
    turns: Array
    """(n, 3, 3), the planned rotation of each target pose, world."""
    play_m: float
    """Clearance per side, by which the models are smaller, like the parts that are made."""
    make_caster: MakeRayCaster
    """Makes the ray caster for these models."""

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        detect_operations = self.detect_operations(demonstration, self.add_noise(rng))
        poses = np.array([demonstration.start[operation.main] for operation in assembly.operations])
        covariance = np.repeat(_UNSEEN[None], len(assembly), axis=0)
        seen = np.zeros(len(assembly), dtype=np.bool_)
        for event in detect_operations:
            k = event.operation
            if event.found is not None and k is not None:
                poses[k] = event.found.T
                covariance[k] = event.found.covariance
                seen[k] = True
        return Observation(
            assembly,
            demonstration.start,
            poses,
            floor_covariance(covariance + demonstration.human_error_covariance),
            seen,
        )

    def add_noise(self, rng: np.random.Generator) -> list[Array]:
        """The images with measurement errors, (views, height, width) each, [m]."""
        return [simulate_range_image(image, self.level_m, rng) for image in self.images]

    def detect_operations(self, demonstration: Demonstration, images: Sequence[Array]) -> tuple[DetectedOperation, ...]:
        """The operations that the sensor detects in measured images, (views, height, width) each, [m]."""
        assembly = demonstration.assembly
        expected = SensorPriors(assembly, demonstration.start, self.turns, self.play_m)
        cast = self.make_caster(assembly.solids, self.play_m)
        return follow_demonstration(images, self.level_m, expected, cast)
