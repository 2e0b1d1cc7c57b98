"""Run a program in any language as a corrector: one line of JSON in, one line of JSON out.

A request, `apo-bench/request/1`, holds everything that a corrector may use: an observation as in files, with `carries`
and `contacts` (pairs of `part.face`) in each operation, `fixed` parts, an `id`, and `faces`. A face (`part.face`) has a
point and a direction in the frame of its part, and radii if it is round. The answer is `{"poses": [pose, ...]}`, one
pose (`position_mm`, `quaternion_wxyz`) per operation.
"""

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, require
from apo_bench.formats.json_forms import PoseForm
from apo_bench.formats.observation_json import make_observation_form
from apo_bench.geometry import Array, Face, RoundFace
from apo_bench.io import FileTable, convert_typed, decode_text, parse_plain, write_file
from apo_bench.names import own_modules_in

REQUEST = "apo-bench/request/1"
LARGEST_ANSWER_BYTES = 16_000_000
ANSWER_LIMIT_S = 120.0
"""Time limit of one answer."""
_ENVIRONMENT = ("PATH", "LANG")
"""Variables that a program gets from the environment; the command `env NAME=value program` adds others."""
_HEX = 32  # digits of the id of a request
_MM = 1e3
_MODULE = """
'''Made by `apo-bench score`.'''

from functools import partial

from apo_bench.benchmark.scoring.program import ask_program

corrector = partial(ask_program, {words}, {folder!r})
"""


@contextmanager
def program_method(command: str, folder: Path) -> Iterator[str]:
    """Name a program as a method, `module:name`, for the duration of the context; a generated module runs it.

    Args:
        command: A program with its arguments, quoted as in a shell; it starts in the current folder, without a shell.
        folder: Where the module is written.

    Raises:
        InputError: There is no such program.
    """
    try:
        words = tuple(shlex.split(command))
    except ValueError as error:
        raise InputError(f"the command {command!r} was given, which is no command line ({error}).") from error
    require(words, "an empty command was given; name a program.")
    require(shutil.which(words[0]), f"the program '{words[0]}' was given, which is not found; give its path.")
    text = _MODULE.format(words=words, folder=str(Path.cwd()))
    name = f"entrant_{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    folder.mkdir(parents=True, exist_ok=True)
    write_file(folder / f"{name}.py", text)
    with own_modules_in(str(folder.resolve())):
        yield f"{name}:corrector"


def ask_program(command: tuple[str, ...], folder: str, observation: Observation) -> Array:
    """Ask a program to correct an observation; return its poses, (n, 4, 4), world, [m].

    Args:
        command: The program and its arguments.
        folder: The folder that it starts in.

    Raises:
        InputError: The program cannot be started, fails, takes too long, or gives no valid answer.
    """
    program = f"the program '{command[0]}'"
    environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    # files, not pipes: the program may write before it reads, and any amount, without a deadlock
    with tempfile.TemporaryFile() as request, tempfile.TemporaryFile() as written:
        request.write(f"{request_line(observation)}\n".encode())
        request.seek(0)
        streams: dict[str, Any] = {"stdin": request, "stdout": written, "cwd": folder, "env": environment}
        try:
            ended = subprocess.run(command, **streams, timeout=ANSWER_LIMIT_S, check=False)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"{program} took longer than {ANSWER_LIMIT_S:g} s and was ended.") from error
        except OSError as error:
            raise InputError(f"{program} cannot be run ({error}).") from error
        written.seek(0)
        answer = written.read(LARGEST_ANSWER_BYTES + 1)  # one byte more than allowed, to detect more
    require(
        len(answer) <= LARGEST_ANSWER_BYTES,
        f"{program} wrote more than {LARGEST_ANSWER_BYTES / 1e6:g} MB; one line of JSON is needed.",
    )
    require(ended.returncode == 0, f"{program} ended with exit code {ended.returncode}.")
    require(answer.strip(), f"{program} wrote no answer; one line of JSON is needed.")
    where = f"the answer of {program.removeprefix('the program ')}"
    form = convert_typed(parse_plain(decode_text(answer, where, "JSON"), where, "json"), _Answer, where)
    count = len(observation.poses)
    require(len(form.poses) == count, f"{where}, poses: {count} entries are needed, {len(form.poses)} were given.")
    poses = [each.matrix(f"{where}, pose {i}") for i, each in enumerate(form.poses, start=1)]
    return np.array(poses).reshape(-1, 4, 4)


def request_line(observation: Observation) -> str:
    """Return a request as one line of JSON; its `id` is a hash of the rest."""
    form = _request_form(observation)
    text = json.dumps(form, sort_keys=True, allow_nan=False)
    return json.dumps({"id": hashlib.sha256(text.encode()).hexdigest()[:_HEX], **form}, allow_nan=False)


def _request_form(observation: Observation) -> dict[str, Any]:
    """Return a request without its `id`: an observation as in files, with contacts and faces instead of a scenario."""
    assembly = observation.assembly
    form = make_observation_form(observation, "")
    del form["scenario"]
    for entry, operation in zip(form["operations"], assembly.operations, strict=True):
        entry["carries"] = list(operation.carries)
        entry["contacts"] = [[str(of) for of in contact] for contact in operation.contacts]
    # a dictionary, to keep their order
    touching = {of: None for operation in assembly.operations for contact in operation.contacts for of in contact}
    faces = {str(of): _face_form(assembly.face_of(of)) for of in touching}
    return {**form, "schema": REQUEST, "fixed": sorted(assembly.fixed), "faces": faces}


class _Answer(FileTable, frozen=True, kw_only=True):
    """The answer of a program to a request."""

    poses: list[PoseForm]
    id: str = ""


def _face_form(face: Face | RoundFace) -> dict[str, Any]:
    """Describe a face in the frame of its part: a flat one by point and outward normal, a round one by its axis."""
    if isinstance(face, Face):
        return {"kind": "plane", "point_mm": (face.outline.mean(axis=0) * _MM).tolist(), "normal": face.normal.tolist()}
    radii = [radius * _MM for radius in face.radii]
    ends = {"ends_mm": (face.ends * _MM).tolist(), "radii_mm": radii, "hole": face.hole}
    return {"kind": face.kind, "point_mm": (face.point * _MM).tolist(), "axis": face.axis.tolist(), **ends}
