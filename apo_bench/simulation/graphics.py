"""Open MuJoCo's renderer or window, or raise an error that names the missing package or display."""

import importlib
import os
import sys
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import SAFE_PATH, set_environment

_VARIABLE = "MUJOCO_GL"
_CHILDREN = {SAFE_PATH: "1"}
"""Environment while GLFW is imported, since that starts a Python process."""
SHADOW_TEXELS = 4096
"""Texels of the shadow map along a side; each covers 0.4 mm on the table."""
_SHADOW_REACH = 0.5
"""Half width of the shadow map, relative to the size of the scene."""


@set_environment(_CHILDREN)
def renderer(model: Any, width: int, height: int, shadow_texels: int = SHADOW_TEXELS) -> Any:
    """MuJoCo's renderer; on Linux without a display it uses EGL, unless MUJOCO_GL is set.

    Args:
        shadow_texels: Texels along a side of the map of shadows, 0 for no shadows; without a graphics card they take
            most of the time.

    Raises:
        InputError: No graphics driver can be used, or the picture is too large.
    """
    most = model.vis.global_.offwidth, model.vis.global_.offheight
    require(
        1 <= width <= most[0] and 1 <= height <= most[1],
        f"a picture of {width} x {height} pixels was given; 1 x 1 to {most[0]} x {most[1]} are allowed.",
    )
    try:
        import mujoco
        from mujoco.rendering.classic import gl_context

        if _VARIABLE not in os.environ and _has_no_display():
            os.environ[_VARIABLE] = "egl"
            importlib.reload(gl_context)  # MuJoCo chose when it was imported
        if gl_context.GLContext.__module__ == "mujoco.glfw" and _has_no_display():
            raise RuntimeError("there is no display")  # drawing without one, MuJoCo ends the process at the second try
        model.vis.quality.shadowsize = shadow_texels
        model.vis.map.shadowclip = _SHADOW_REACH
        made = mujoco.Renderer(model, height, width)
        made.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadow_texels > 0
        return made
    except ValueError:
        raise
    except Exception as error:
        reason = _reason(error)
        if _VARIABLE in os.environ and _VARIABLE not in reason:
            reason = f"{_VARIABLE}={os.environ[_VARIABLE]}: {reason}"
        raise InputError(
            f"no picture can be drawn here ({reason}); without a display install libegl1, "
            "libopengl0 and libgl1-mesa-dri (Debian) and set MUJOCO_GL=egl."
        ) from error


@set_environment(_CHILDREN)
def need_window() -> None:
    """Raise an error instead of opening a window for which MuJoCo's viewer would end the process.

    Raises:
        InputError: There is no display.
    """
    require(
        not _has_no_display(),
        "no window can be opened here (there is no display); run it where there is one, or use "
        "render_mode='rgb_array' or a film.",
    )
    importlib.import_module("mujoco.viewer")


def _has_no_display() -> bool:
    """Whether this is a Linux machine whose variables name no display."""
    return sys.platform.startswith("linux") and not any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))


def _reason(error: Exception) -> str:
    """The cause of a graphics error in one line."""
    if isinstance(error, AttributeError) and "NoneType" in str(error):
        return "its library is not installed"
    cause = error.__cause__ or error  # MuJoCo 4 says around it what to install, and repeats the variable
    return (str(cause).splitlines() or [type(cause).__name__])[0].rstrip(".")
