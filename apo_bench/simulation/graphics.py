"""Open MuJoCo's renderer or window, or name what is missing."""

import importlib
import os
import sys
import warnings
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import SAFE_PATH, environment

_VARIABLE = "MUJOCO_GL"
_CHILDREN = {SAFE_PATH: "1"}
"""While GLFW is imported, which starts a Python process."""
_SHADOW_TEXELS = 4096
_SHADOW_REACH = 0.5
"""Texels of the shadow map along a side, and its half width over the size of the scene: 0.4 mm on the table each."""


@environment(_CHILDREN)
def renderer(model: Any, width: int, height: int) -> Any:
    """MuJoCo's renderer; on a Linux machine without a display it draws through EGL, unless MUJOCO_GL says otherwise.

    Raises:
        InputError: There is nothing to draw with, or the picture is too large.
    """
    most = model.vis.global_.offwidth, model.vis.global_.offheight
    require(
        1 <= width <= most[0] and 1 <= height <= most[1],
        f"a picture of {width} x {height} pixels was given; 1 x 1 to {most[0]} x {most[1]} are allowed.",
    )
    try:
        import mujoco
        from mujoco.rendering.classic import gl_context

        if _VARIABLE not in os.environ and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
            os.environ[_VARIABLE] = "egl"
            importlib.reload(gl_context)  # where somebody else imported MuJoCo it has chosen already
        if gl_context.GLContext.__module__ == "mujoco.glfw" and (why := _no_window()):
            raise RuntimeError(why)  # drawing without a display, MuJoCo ends the process at the second try
        model.vis.quality.shadowsize = _SHADOW_TEXELS
        model.vis.map.shadowclip = _SHADOW_REACH
        return mujoco.Renderer(model, height, width)
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


@environment(_CHILDREN)
def need_window() -> None:
    """Refuse what MuJoCo's viewer would end the process for.

    Raises:
        InputError: There is no display, or none that can draw.
    """
    if sys.platform == "darwin":
        return
    if why := _no_window():
        raise InputError(
            f"no window can be opened here ({why}); run it where there is a display, or use render_mode='rgb_array' or "
            "a film."
        )


def _no_window() -> str:
    """Why GLFW cannot open a window, empty where it can."""
    try:
        import glfw
    except ImportError as error:
        return _reason(error)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        try:
            window = _hidden_window(glfw)
        except glfw.GLFWError as error:
            return _reason(error)
    if window:
        glfw.destroy_window(window)
        return ""
    message: Any = glfw.get_error()[1]
    return message.decode(errors="replace") if message else "there is no display"


def _hidden_window(glfw: Any) -> Any:
    if not glfw.init():
        return None
    glfw.default_window_hints()
    glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
    try:
        return glfw.create_window(64, 64, "", None, None)
    finally:
        glfw.default_window_hints()


def _reason(error: Exception) -> str:
    if isinstance(error, AttributeError) and "NoneType" in str(error):
        return "its library is not installed"
    cause = error.__cause__ or error  # MuJoCo 4 says around it what to install, and repeats the variable
    return (str(cause).splitlines() or [type(cause).__name__])[0].rstrip(".")
