"""What changes between the episodes of `APOInsert-v0` by its argument `randomise`: physics and the sensor."""

from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.scene import PhysicsScale

LEAST_LAYOUTS = 256
"""Least number of training starts with randomisation."""
_FRICTION = 0.3  # greatest change of the friction of parts, as a share
_MASS = 0.3  # the same of their masses
_GAIN = 0.1  # the same of the gains of the servos
_DEAD_ZONE = np.repeat([0.1, 0.005], 3)  # greatest dead zone of the force-torque sensor, [N, Nm]


@final
class EpisodeVariation(NamedTuple):
    """The physics and the sensor of one episode."""

    scale: PhysicsScale = PhysicsScale()
    dead_zone: float = 0.0
    """Dead zone of the force-torque sensor, as a share of the greatest one."""

    def felt(self, wrench: Array) -> Array:
        """Return a wrench, (6,), [N, Nm], less the dead zone: zero inside of it, and reduced by it outside."""
        return np.asarray(np.sign(wrench) * np.maximum(np.abs(wrench) - self.dead_zone * _DEAD_ZONE, 0.0))


NONE = EpisodeVariation()
"""No variation."""


def draw_variation(randomise: float, rng: np.random.Generator) -> EpisodeVariation:
    """Draw the variation of an episode; with a scale of 0 nothing is drawn from the generator."""
    if not randomise:
        return NONE
    sizes = randomise * np.array([_FRICTION, _MASS, _GAIN])
    factors = 1.0 + sizes * rng.uniform(-1.0, 1.0, 3)
    return EpisodeVariation(PhysicsScale(*factors.tolist()), randomise * float(rng.uniform()))
