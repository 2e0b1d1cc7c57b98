"""Import MuJoCo without a graphics driver; the first picture loads the driver.

MuJoCo chooses its OpenGL backend by the variable MUJOCO_GL during its import. A driver loaded then stays in the
process, and the LLVM of Mesa's driver crashes other packages (Triton, so PyTorch with CUDA). If MuJoCo was imported
before, nothing changes.
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
    """Import MuJoCo without a backend; `mujoco.GLContext` is loaded at its first use."""
    if "mujoco" in sys.modules:
        return
    with set_environment(_NO_BACKEND):
        mujoco = importlib.import_module("mujoco")
    contexts = importlib.import_module("mujoco.rendering.classic.gl_context")
    for module in (contexts, mujoco, importlib.import_module("mujoco.gl_context")):
        _choose_later(module, contexts)


def _choose_later(module: ModuleType, source: ModuleType) -> None:
    """Remove `GLContext` from a module; its first use reloads `source` under the value of MUJOCO_GL at that time."""
    wanted = "GLContext"
    vars(module).pop(wanted, None)

    def chosen(name: str) -> Any:
        """The module's `__getattr__` for missing attributes (PEP 562)."""
        if name != wanted:
            raise AttributeError(f"module '{module.__name__}' has no attribute '{name}'")
        if name not in vars(source):
            importlib.reload(source)
        if name not in vars(source):
            raise AttributeError(f"{_VARIABLE}={os.environ.get(_VARIABLE)} turns pictures off")
        return vars(source)[name]

    vars(module)["__getattr__"] = chosen
