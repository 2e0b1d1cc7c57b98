"""Arms of strangers are put together in a process of their own, with little memory and time."""

import os
import pickle
import resource
import subprocess
import sys
from contextlib import suppress
from typing import Any

from apo_bench.errors import InputError
from apo_bench.simulation.arms.arm import Arm, ArmDescription

_START = "import sys; sys.path[:] = sys.argv[1:]; from apo_bench.simulation.arms.apart import run_child; run_child()"
_LIMIT_S = 60
_WALL_S = 180
_LIMIT_BYTES = 4_000_000_000
_LARGEST_FILE = 100_000
"""Bytes that a library may write into a file."""


def build_apart(description: ArmDescription) -> Arm:
    """What `build_arm` makes of a description.

    Raises:
        InputError: As there; or it takes too long or too much memory, or ends its process.
    """
    mjcf = description.mjcf
    command = [sys.executable, "-P", "-c", _START, *sys.path]
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        child = subprocess.run(
            command, input=pickle.dumps(description), capture_output=True, timeout=_WALL_S, check=False, env=one_thread
        )
        kind, answer = pickle.loads(child.stdout)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{mjcf}: MuJoCo needs more than {_WALL_S} s for this arm; make it simpler.") from error
    except (pickle.UnpicklingError, EOFError) as error:
        raise InputError(
            f"{mjcf}: MuJoCo ends without a word, or needs more than {_LIMIT_S} s or {_LIMIT_BYTES / 1e9:g} GB, "
            "for this arm; make it simpler."
        ) from error
    if kind == "refused":
        raise InputError(answer)
    arm: Arm = answer
    return arm


def run_child() -> None:
    """Read a description from the standard input, and write what came of it to the standard output, pickled."""
    import mujoco

    from apo_bench.simulation.arms.building import build_arm

    # otherwise MuJoCo writes MUJOCO_LOG.TXT into the user's folder when a stranger's gripper is unstable
    mujoco.set_mju_user_warning(lambda _: None)
    description: ArmDescription = pickle.loads(sys.stdin.buffer.read())
    out = os.dup(1)
    os.dup2(2, 1)
    limits = (
        (resource.RLIMIT_AS, _LIMIT_BYTES),
        (resource.RLIMIT_CPU, _LIMIT_S),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, _LARGEST_FILE),
    )
    for what, most in limits:
        with suppress(OSError, ValueError):
            resource.setrlimit(what, (most, most))
    answer: tuple[str, Any]
    try:
        answer = "arm", build_arm(description)
    except InputError as error:
        answer = "refused", str(error)
    except MemoryError:
        answer = (
            "refused",
            f"{description.mjcf}: MuJoCo needs more than {_LIMIT_BYTES / 1e9:g} GB; make the arm simpler.",
        )
    with os.fdopen(out, "wb") as file:
        file.write(pickle.dumps(answer))
