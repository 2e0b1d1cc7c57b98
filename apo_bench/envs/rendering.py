"""Pictures and windows of an episode."""

from typing import Any, final

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.geometry import Array
from apo_bench.simulation.scene import Scene

MODES = ("rgb_array", "rgb_array_list", "human")
FPS = 25
FILM_SPEED = 4.0
"""A film is shown so many times as fast as the replay was."""
_PICTURE = (640, 480)
_SMALL = (320, 240)
"""Width and height of a picture, and of one of a film."""


@final
class Rendering:
    """What there is to show; nothing is kept that the mode does not ask for."""

    def __init__(self, poses: Poses) -> None:
        self.begin(poses)
        self.window: Any = None

    def begin(self, poses: Poses) -> None:
        """Parts stand like this before the step."""
        self.poses = poses
        self.state: Array | None = None
        self._frames: list[Any] = []

    def watch(self, scene: Scene, mode: str | None) -> Any:
        """What looks on at a replay: in mode `human` a new window, since every replay has its own data."""
        if mode == "human":
            from apo_bench.simulation.scene.render import ReplayWindow

            self.close()
            self.window = ReplayWindow(scene)
        if mode == "rgb_array_list":
            from apo_bench.simulation.scene.render import Film

            film = Film(scene, FPS, *_SMALL, speed=FILM_SPEED)
            self._frames = film.frames
            return film
        return self._remember if mode == "rgb_array" else self.window

    def shown(self, scene: Scene, mode: str | None) -> Any:
        """As `APOReplay.render`."""
        if mode in (None, "human"):
            return None
        from apo_bench.simulation.scene.render import picture_with_arm

        if mode == "rgb_array":
            return picture_with_arm(scene, self.poses, self.state, *_PICTURE)
        return [*self._frames] or [picture_with_arm(scene, self.poses, None, *_SMALL)]

    def close(self) -> None:
        """Close the window, if one is open."""
        if self.window is not None:
            self.window.close()
            self.window = None

    def __getstate__(self) -> dict[str, Any]:
        """All but the window."""
        return {**self.__dict__, "poses": dict(self.poses), "window": None}

    def _remember(self, data: Any) -> None:
        self.state = np.array(data.qpos)
