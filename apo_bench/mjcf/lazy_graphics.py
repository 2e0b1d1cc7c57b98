"""Import MuJoCo without a graphics driver, which the first picture loads.

MuJoCo chooses its OpenGL backend by the variable MUJOCO_GL while it is imported, and a driver that is loaded then stays
in the process: Mesa's brings an LLVM that other packages (Triton, so PyTorch with CUDA) do not survive. If MuJoCo
was imported before, it stays as it is.
"""

import importlib
import os
import sys
from types import ModuleType
from typing import Any

from apo_bench.io import set_environment

_VARIABLE = "MUJOCO_GL"
_NO_BACKEND = {_VARIABLE: "disable"}


def import_mujoco() -> None:
    """Import MuJoCo; `mujoco.GLContext` is there at its first use."""
    if "mujoco" in sys.modules:
        return
    with set_environment(_NO_BACKEND):
        mujoco = importlib.import_module("mujoco")
    contexts = importlib.import_module("mujoco.rendering.classic.gl_context")
    for module in (contexts, mujoco, importlib.import_module("mujoco.gl_context")):
        _choose_later(module, contexts)


def _choose_later(module: ModuleType, source: ModuleType) -> None:
    """Take the context out of a module; its first use runs `source` again, under the variable as it is then."""
    wanted = "GLContext"
    vars(module).pop(wanted, None)

    def chosen(name: str) -> Any:
        if name != wanted:
            raise AttributeError(f"module '{module.__name__}' has no attribute '{name}'")
        if name not in vars(source):
            importlib.reload(source)
        if name not in vars(source):
            raise AttributeError(f"{_VARIABLE}={os.environ.get(_VARIABLE)} turns pictures off")
        return vars(source)[name]

    vars(module)["__getattr__"] = chosen
