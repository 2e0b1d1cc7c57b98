"""A program in any language as a corrector: for each trial it is started, reads one line of JSON and writes one.

A request, `apo-bench/request/1`, is all that a corrector may use: an observation as files have it, with `carries` and
`contacts` (pairs of `part.face`) in each operation, `faces` (`part.face` -> a point and a direction in the frame of the
part, radii where it is round), `fixed` parts, and an `id`. The answer is `{"poses": [pose, ...]}`, one pose
(`position_mm`, `quaternion_wxyz`) for each operation.
"""

import hashlib
import json
import os
import signal
import subprocess
import tempfile
from contextlib import suppress
from threading import Timer
from typing import Any

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, require
from apo_bench.formats.json_forms import PoseForm
from apo_bench.formats.observation_json import observation_form
from apo_bench.geometry import Array, Face, RoundFace
from apo_bench.io import Table, convert_typed, decoded, parse_plain

REQUEST = "apo-bench/request/1"
LARGEST_ANSWER_BYTES = 16_000_000
"""A program that writes more is ended."""
ANSWER_LIMIT_S = 120.0
"""A program that takes longer is ended."""
_ENVIRONMENT = ("PATH", "LANG")
"""All that a program finds in its environment; `env NAME=value program` as command gives it more."""
_HEX = 32
_MM = 1e3


def ask_program(command: tuple[str, ...], folder: str, observation: Observation) -> Array:
    """The goals that a program makes of an observation, (n, 4, 4), [m].

    Args:
        command: The program and its arguments.
        folder: Where it starts.

    Raises:
        InputError: It cannot be started, fails, takes too long, or answers something else.
    """
    program = f"the program '{command[0]}'"
    process = _start(command, folder, f"{request_line(observation)}\n".encode())
    limit = Timer(ANSWER_LIMIT_S, _end, [process])
    limit.start()
    with process:
        answer = process.stdout.read(LARGEST_ANSWER_BYTES + 1) if process.stdout else b""
        if len(answer) > LARGEST_ANSWER_BYTES:
            _end(process)
    is_late = not limit.is_alive()
    limit.cancel()
    require(
        len(answer) <= LARGEST_ANSWER_BYTES,
        f"{program} wrote more than {LARGEST_ANSWER_BYTES / 1e6:g} MB and was ended; one line of JSON is needed.",
    )
    require(not is_late, f"{program} took longer than {ANSWER_LIMIT_S:g} s and was ended.")
    require(process.returncode == 0, f"{program} ended with exit code {process.returncode}.")
    require(answer.strip(), f"{program} wrote no answer; one line of JSON is needed.")
    where = f"the answer of {program.removeprefix('the program ')}"
    _, poses = parse_answer(decoded(answer, where, "JSON"), where)
    count = len(observation.poses)
    require(len(poses) == count, f"{where}, poses: {count} entries are needed, {len(poses)} were given.")
    return poses


def request_line(observation: Observation) -> str:
    """A request on one line; its `id` is a hash of all else, so that an answer finds its question."""
    form = request_form(observation)
    text = json.dumps(form, sort_keys=True, allow_nan=False)
    return json.dumps({"id": hashlib.sha256(text.encode()).hexdigest()[:_HEX], **form}, allow_nan=False)


def request_form(observation: Observation) -> dict[str, Any]:
    """What was seen, as a request without its `id`: the form of an observation, with contacts and faces in place of the
    name of a scenario."""
    assembly = observation.assembly
    form = observation_form(observation, "")
    del form["scenario"]
    for entry, operation in zip(form["operations"], assembly.operations, strict=True):
        entry["carries"] = list(operation.carries)
        entry["contacts"] = [[str(of) for of in contact] for contact in operation.contacts]
    touching = {of: None for operation in assembly.operations for contact in operation.contacts for of in contact}
    faces = {str(of): _face_form(assembly.face_of(of)) for of in touching}
    return {**form, "schema": REQUEST, "fixed": sorted(assembly.fixed), "faces": faces}


class _Answer(Table, frozen=True, kw_only=True):
    poses: list[PoseForm]
    id: str = ""


def parse_answer(text: str, where: str) -> tuple[str, Array]:
    """Parse an answer.

    Args:
        where: Where it stands, for the message.

    Returns:
        Its `id`, and its poses, (n, 4, 4), [m].

    Raises:
        InputError: It is no answer.
    """
    answer = convert_typed(parse_plain(text, where, "json"), _Answer, where)
    poses = [form.matrix(f"{where}, pose {i}") for i, form in enumerate(answer.poses, start=1)]
    return answer.id, np.array(poses).reshape(-1, 4, 4)


def _start(command: tuple[str, ...], folder: str, request: bytes) -> subprocess.Popen[bytes]:
    """Start a program in a session of its own; the request is a file, so that it may write before it reads."""
    environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    pipe = subprocess.PIPE
    with tempfile.TemporaryFile() as stdin:
        stdin.write(request)
        stdin.seek(0)
        try:
            return subprocess.Popen(
                command, stdin=stdin, stdout=pipe, cwd=folder, env=environment, start_new_session=True
            )
        except OSError as error:
            raise InputError(f"the program '{command[0]}' cannot be run ({error}).") from error


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a program, and its children where there are groups of processes."""
    process.kill()
    with suppress(AttributeError, ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _face_form(face: Face | RoundFace) -> dict[str, Any]:
    """A face in the frame of its part: a flat one by a point and its outward normal, a round one by its axis."""
    if isinstance(face, Face):
        return {"kind": "plane", "point_mm": (face.outline.mean(axis=0) * _MM).tolist(), "normal": face.normal.tolist()}
    radii = [radius * _MM for radius in face.radii]
    ends = {"ends_mm": (face.ends * _MM).tolist(), "radii_mm": radii, "hole": face.hole}
    return {"kind": face.kind, "point_mm": (face.point * _MM).tolist(), "axis": face.axis.tolist(), **ends}
