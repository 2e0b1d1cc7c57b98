"""No graphics driver is loaded before the first picture; where none works, one sentence says so."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

LOADED = """
import re, sys

def loaded():
    libraries = re.findall(r"(?im)/[^/ ]*(?:egl|libgl|gallium|llvm|osmesa|swrast|_dri|libgbm)[^/ ]*$",
                           open("/proc/self/maps").read())
    return sorted({*libraries, *(name for name in sys.modules if name.split(".")[0] in ("OpenGL", "glfw"))})
"""
REPLAY = """
import gymnasium, apo_bench
env = gymnasium.make(
    "APOReplay-v0", scenario="block_on_block", noise_level=0.0, human_error_scale=0.0, render_mode=MODE
)
env.reset(seed=0)
info = env.step(0 * env.action_space.sample())[-1]
scene = env.unwrapped._scene
"""
DRAW = """
from apo_bench.errors import InputError
from apo_bench.simulation.scene.render import draw_picture
for _ in range(2):
    try:
        print(draw_picture(scene, {}, 64, 48).shape)
    except InputError as error:
        print(error)
"""
linux = pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="libraries are read from /proc")


def python(code: str, backend: str | None) -> subprocess.CompletedProcess[str]:
    """Run it in a process without a display, MUJOCO_GL as given."""
    kept = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY")}
    kept.pop("WAYLAND_DISPLAY", None)
    variables = {} if backend is None else {"MUJOCO_GL": backend}
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**kept, **variables},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@linux
def test_a_replay_loads_no_graphics_driver_and_a_picture_is_drawn_afterwards() -> None:
    code = f"MODE = None{LOADED}{REPLAY}print(loaded(), info['is_success'])\n{DRAW}"
    code += "print(any('EGL' in name for name in loaded()))\n"
    done = python(code, "egl")
    assert (done.returncode, done.stderr) == (0, "")
    replayed, *drawn = done.stdout.splitlines()
    assert replayed == "[] True"
    if "no picture can be drawn here" in drawn[0]:
        pytest.skip(drawn[0])
    assert drawn == ["(48, 64, 3)", "(48, 64, 3)", "True"]


@linux
def test_a_window_without_a_display_is_one_sentence_and_not_the_end_of_the_process() -> None:
    code = f"MODE = 'human'\nfrom apo_bench.errors import InputError\ntry:{REPLAY.replace(chr(10), chr(10) + '    ')}\n"
    done = python(f"{code}\nexcept InputError as error:\n    print(error)\n", None)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("no window can be opened here (")
    assert done.stdout.count("\n") == 1
