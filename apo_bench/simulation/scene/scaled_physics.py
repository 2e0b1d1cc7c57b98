"""Friction, masses and servo gains of a scene, scaled for a while."""

from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.scene.scene import Scene

# arrays of MuJoCo's model
_FRICTION = "geom_friction"
_GAINS = ("actuator_gainprm", "actuator_biasprm")
_MASSES = ("body_mass", "body_subtreemass", "body_inertia")


class PhysicsScale(NamedTuple):
    """Factors on the physics of a scene; 1 leaves it as it is."""

    friction: float = 1.0
    """Of the sliding friction of all parts."""
    mass: float = 1.0
    """Of all movable parts."""
    gain: float = 1.0
    """Of stiffness and damping of the servos of the arm."""


@final
class ScaledPhysics:
    """A scene whose model of the replay is scaled until `restore` is called."""

    def __init__(self, scene: Scene, scale: PhysicsScale) -> None:
        work = scene.work
        model = work.model
        is_part = work.geom_part >= 0
        bodies = np.isin(model.body_rootid, [work.body[part] for part in work.free])
        drives = [model.actuator(f"arm/{name}").id for name in scene.arm.joints]
        self._model = model
        self._before: dict[str, Array] = {name: getattr(model, name).copy() for name in (*_GAINS, *_MASSES, _FRICTION)}
        model.geom_friction[is_part, 0] *= scale.friction
        for name in _GAINS:
            getattr(model, name)[drives] *= scale.gain
        for name in _MASSES:
            getattr(model, name)[bodies] *= scale.mass

    def restore(self) -> None:
        """Give the model its own physics back."""
        for name, before in self._before.items():
            getattr(self._model, name)[:] = before
