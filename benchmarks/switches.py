"""Run a command under other kernels of OpenBLAS and NumPy: `python -m benchmarks.switches COMMAND...`.

Both choose their code by the processor, so results differ between processors in their last bits. A switch counts
only where a process under it confirms it; one that the processor does not allow is printed and left out. The variable
APO_BENCH_KERNELS names the expected kernels for the command. Without a command: the kernels in use here, as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

BLAS = ("Haswell", "Zen", "SkylakeX", "Nehalem")
"""Names that OPENBLAS_CORETYPE knows. One that it does not know is passed over in silence; one whose instructions the
processor lacks is taken all the same, and the first of them ends the process."""
EXPECTED = "APO_BENCH_KERNELS"
AT_ONCE = 2  # kernels whose commands run together
PROCESSES = "{processes}"
"""Stands in a command of pytest for how many processes it starts: none of its own where several kernels run together,
so that what a process imports is paid once per kernel."""
OUTPUT = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}


@dataclass(frozen=True)
class Kernels:
    """What runs in one process."""

    blas: tuple[str, ...]
    """The kernels of every OpenBLAS that is loaded, NumPy's and SciPy's; none where neither uses one."""
    numpy: tuple[str, ...]
    """Features above the least that NumPy was built for."""


@dataclass(frozen=True)
class Switch:
    name: str
    environment: Mapping[str, str]
    kernels: Kernels


def in_use() -> Kernels:
    """The kernels of this process, after some work with them."""
    import numpy as np
    import scipy.linalg
    from numpy._core import _multiarray_umath as compiled
    from threadpoolctl import threadpool_info

    A = np.eye(40) + np.arange(1600.0).reshape(40, 40) / 1e5
    for solved in (np.linalg.solve(A, A), scipy.linalg.solve(A, A)):
        assert np.allclose(solved, np.eye(40))
    blas = tuple(sorted(str(one["architecture"]) for one in threadpool_info() if one["internal_api"] == "openblas"))
    features = compiled.__cpu_features__
    return Kernels(blas, tuple(name for name in compiled.__cpu_dispatch__ if features[name]))


def under(environment: Mapping[str, str]) -> Kernels | str:
    """The kernels of a process with these variables, or why there are none."""
    ran = subprocess.run(
        [sys.executable, "-P", __file__],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if ran.returncode == -signal.SIGILL:
        return "this processor lacks instructions that it needs"
    if ran.returncode != 0:
        return f"a process under it ended with {ran.returncode}"
    return Kernels(**{name: tuple(value) for name, value in json.loads(ran.stdout).items()})


def switches(own: Kernels) -> Iterator[Switch | str]:
    """Every switch that took, or a sentence on one that is not run, given the kernels without any."""
    plain = {"NPY_DISABLE_CPU_FEATURES": " ".join(own.numpy)}
    found = under(plain)
    if isinstance(found, str):
        yield f"vector features off is not run: {found}"
    elif found.numpy:
        yield f"vector features off is not run: {found.numpy} stay on"
    elif not own.numpy:
        yield "vector features off is not run again: NumPy uses none on this processor"
    else:
        yield Switch("vector features of NumPy off", plain, found)
    for name in BLAS:
        found = under({"OPENBLAS_CORETYPE": name}) if own.blas else "neither NumPy nor SciPy uses OpenBLAS"
        if isinstance(found, str):
            yield f"{name} is not run: {found}"
        elif {one.lower() for one in found.blas} != {name.lower()}:
            yield f"{name} is not run: OpenBLAS takes {' and '.join(sorted(set(found.blas)))} for it on this processor"
        elif found.blas == own.blas:
            yield f"{name} is not run again: it is what OpenBLAS takes on this processor by itself"
        else:
            yield Switch(f"OpenBLAS {name}", {"OPENBLAS_CORETYPE": name}, found)


def taken(own: Kernels) -> Iterator[Switch]:
    """The switches that took; what is left out is printed."""
    for switch in switches(own):
        if isinstance(switch, Switch):
            yield switch
        else:
            print(f"-- {switch}", flush=True)


def run(switch: Switch, command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
    """Run the command under the switch, with the kernels that it has to find."""
    environment = {**os.environ, **switch.environment, EXPECTED: json.dumps(asdict(switch.kernels))}
    return subprocess.run(command, env=environment, text=True, check=False, **options)  # type: ignore[call-overload]


def missing() -> str | None:
    """What is wrong where the kernels of this process are not those that it was started for."""
    environment = os.environ.get(EXPECTED)
    found = json.loads(json.dumps(asdict(in_use()))) if environment is not None else None
    return (
        None
        if environment is None or found == json.loads(environment)
        else f"the kernels here are {found}, not {environment}"
    )


def main(command: list[str]) -> int:
    if not command:
        print(json.dumps(asdict(in_use())))
        return 0
    own = under({})
    if isinstance(own, str):
        print(f"the kernels of this processor are not known: {own}")
        return 1
    to_run = list(taken(own))
    processes = "0" if len(to_run) > 1 else str(AT_ONCE)
    command = [processes if word == PROCESSES else word for word in command]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        runs = [(switch, pool.submit(run, switch, command, **OUTPUT)) for switch in to_run]
        for switch, ended in runs:
            print(f"-- under {switch.name}\n{ended.result().stdout}", end="", flush=True)
    return int(any(ended.result().returncode for _, ended in runs))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
