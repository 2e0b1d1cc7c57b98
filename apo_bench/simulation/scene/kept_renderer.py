"""A renderer that is kept between the pictures of a scene, since making one takes longer than a picture."""

import weakref
from collections.abc import Callable
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.simulation.graphics import renderer


@final
class KeptRenderer:
    """Draws pictures of one model, all of the same size."""

    def __init__(self, model: Any, width: int, height: int, shadow_texels: int = 0) -> None:
        """Open a renderer.

        Args:
            model: The `mujoco.MjModel`.
            width, height: [pixels].
            shadow_texels: As of `renderer`; default: no shadows.

        Raises:
            InputError: No graphics driver can be used, or the picture is too large.
        """
        self._renderer = renderer(model, width, height, shadow_texels)
        self.close = weakref.finalize(self, _release, self._renderer)
        """Frees the renderer; this also happens when the object is deleted."""

    def draw(self, data: Any, camera: Any, adjust: Callable[[Any], None] | None = None) -> NDArray[np.uint8]:
        """Return a picture of a state (`mujoco.MjData`), (height, width, 3), uint8.

        Args:
            camera: The name of a camera, or a `mujoco.MjvCamera`.
            adjust: A function that changes MuJoCo's abstract scene before it is drawn.
        """
        self._renderer.update_scene(data, camera=camera)
        if adjust is not None:
            adjust(self._renderer.scene)
        return np.array(self._renderer.render())


def _release(renderer: Any) -> None:
    """Close a renderer in its own OpenGL context; in another one it would free that one's resources."""
    context = renderer._gl_context
    if context is not None:
        context.make_current()
    renderer.close()
