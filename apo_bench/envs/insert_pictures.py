"""Images of an episode of `APOInsert-v0`, by renderers that are kept between them."""

import math
from typing import Any, final

from apo_bench.simulation.scene import WRIST_CAMERA, KeptRenderer, Scene, aim_camera
from apo_bench.simulation.task.tip_control import TipControl

_SCENE_CAMERA = (0.22, 40.0, -25.0)
"""Distance from the estimated entrance of the hole, [m]; azimuth against the insertion and elevation, [deg]."""


@final
class EpisodePictures:
    """Draws images of one scene at a time; copies have no renderer until they draw."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._kept: dict[tuple[int, int], KeptRenderer] = {}

    def draw(self, scene: Scene, control: TipControl, camera: str, width: int, height: int) -> Any:
        """Return the arm and the parts as they are now, (height, width, 3) of uint8.

        Args:
            camera: `scene`, `wrist`, or one of the room.
        """
        if scene is not self._scene:
            self.close()
            self._scene = scene
        if (width, height) not in self._kept:
            self._kept[width, height] = KeptRenderer(scene.work.model, width, height)
        distance, beside, elevation = _SCENE_CAMERA
        x, y, _ = control.start.direction
        ahead = math.degrees(math.atan2(y, x))  # a view along the insertion
        where: Any = {
            "scene": aim_camera(control.entrance, distance, ahead + beside, elevation),
            "wrist": WRIST_CAMERA,
        }.get(camera, camera)
        return self._kept[width, height].draw(control.robot.data, where)

    def close(self) -> None:
        """Free the renderers."""
        for kept in self._kept.values():
            kept.close()
        self._kept.clear()

    def __getstate__(self) -> dict[str, Any]:
        return {"_scene": None, "_kept": {}}
