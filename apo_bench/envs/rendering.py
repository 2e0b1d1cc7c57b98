"""Images, films and windows of an episode."""

from typing import Any, final

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.geometry import Array
from apo_bench.simulation.scene import Scene

MODES = ("rgb_array", "rgb_array_list", "human")
FPS = 25  # frames per second of a film
FILM_SPEED = 4.0
"""Playback speed of a film relative to the replay."""
_PICTURE = (640, 480)  # width and height of an image, in pixels
_SMALL = (320, 240)  # width and height of a frame of a film, in pixels


@final
class Rendering:
    """The images of an episode; nothing is recorded that the render mode does not need."""

    def __init__(self, poses: Poses) -> None:
        self.begin(poses)
        self.window: Any = None

    def begin(self, poses: Poses) -> None:
        """Start an episode with the parts at these poses."""
        self.poses = poses
        self.state: Array | None = None  # joint positions at the end of the replay
        self._frames: list[Any] = []

    def watch(self, scene: Scene, mode: str | None) -> Any:
        """Return the callback for a replay; in mode `human` a new window, since every replay has its own data."""
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
        """Return the images, as `APOReplay.render` does."""
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
        """Return the state without the window, which cannot be copied."""
        return {**self.__dict__, "poses": dict(self.poses), "window": None}

    def _remember(self, data: Any) -> None:
        """Keep the joint positions; the last call of a replay leaves those at its end."""
        self.state = np.array(data.qpos)
