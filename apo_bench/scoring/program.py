"""Entrants that are no Python: a program that is asked and answers by a line of JSON, or goals out of a file.

A request, `apo-bench/request/1`, is all that a corrector may use: an observation as files have it, with `carries` and
`contacts` (pairs of `part.face`) in each operation, `faces` (`part.face` -> a point and a direction in the frame of the
part, radii where it is round), `fixed` parts, and an `id`. The answer is `{"goals": [pose, ...]}`, one pose
(`position_mm`, `quaternion_wxyz`) for each operation.
"""

import hashlib
import json
import os
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, require
from apo_bench.files.json_forms import observation_form
from apo_bench.geometry import Array, Face, RoundFace, pose
from apo_bench.io import JsonNode, decoded, end_descendants, opened, parse_json, read_json, write_file

REQUEST = "apo-bench/request/1"
_HEX = 32
_MM = 1e3
LARGEST_ANSWER_BYTES = 16_000_000
"""A program that writes more is ended."""
LARGEST_ANSWERS_BYTES = 256_000_000
"""A file of answers; those for all tracks have 3 MB."""
_LONGEST_LINE = 1_000_000
"""Bytes of one answer in a file."""
_ENVIRONMENT = ("PATH", "LANG")
"""All that a program finds in its environment; `env NAME=value program` as command gives it more."""


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


def request_line(observation: Observation) -> str:
    """A request on one line; its `id` is a hash of all else, so that an answer finds its question."""
    form = request_form(observation)
    text = json.dumps(form, sort_keys=True, allow_nan=False)
    return json.dumps({"id": hashlib.sha256(text.encode()).hexdigest()[:_HEX], **form}, allow_nan=False)


@final
@dataclass(frozen=True)
class Program:
    """A corrector that starts a program, writes a request to it and reads its answer."""

    command: tuple[str, ...]
    folder: str
    """Where it starts."""

    def __call__(self, observation: Observation) -> Array:
        """Its goals, (n, 4, 4), [m].

        Raises:
            InputError: It cannot be started, fails, or answers something else.
        """
        answer = self._run(f"{request_line(observation)}\n".encode())
        require(answer.strip(), f"the program '{self.command[0]}' wrote no answer; one line of JSON is needed.")
        where = f"the answer of '{self.command[0]}'"
        return goals_of(parse_json(decoded(answer, where, "JSON"), where), len(observation.goals))

    def _run(self, request: bytes) -> bytes:
        """What the program writes when it is given a request."""
        program = f"the program '{self.command[0]}'"
        environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
        with tempfile.TemporaryFile() as stdin:  # a file and no pipe: a program may write before it has read all
            stdin.write(request)
            stdin.seek(0)
            try:
                process = subprocess.Popen(
                    self.command, stdin=stdin, stdout=subprocess.PIPE, cwd=self.folder, env=environment
                )
            except OSError as error:
                raise InputError(f"{program} cannot be run ({error}).") from error
        with process:
            assert process.stdout is not None
            answer = process.stdout.read(LARGEST_ANSWER_BYTES + 1)
            if len(answer) > LARGEST_ANSWER_BYTES:
                end_descendants(process.pid)
                process.kill()
                raise InputError(
                    f"{program} wrote more than {LARGEST_ANSWER_BYTES / 1e6:g} MB and was ended; "
                    "one line of JSON is needed."
                )
        require(process.returncode == 0, f"{program} ended with exit code {process.returncode}.")
        return answer


@final
@dataclass(frozen=True)
class Answers:
    """A corrector whose goals stand in a folder, one file `ID.json` for each request."""

    folder: str

    def __call__(self, observation: Observation) -> Array:
        """The goals that the folder has for this observation, (n, 4, 4), [m].

        Raises:
            InputError: It has none.
        """
        path = Path(self.folder) / f"{json.loads(request_line(observation))['id']}.json"
        return goals_of(read_json(path), len(observation.goals))


@final
@dataclass(frozen=True)
class Export:
    """A corrector that writes each request into a folder, one file each, and corrects nothing."""

    folder: str

    def __call__(self, observation: Observation) -> Array:
        """Never returns.

        Raises:
            InputError: Always, when the request was written.
        """
        line = request_line(observation)
        write_file(Path(self.folder) / f"{json.loads(line)['id']}.json", line + "\n")
        raise InputError("the request was written, and nothing was corrected.")


def read_answers(path: Path) -> dict[str, str]:
    """The lines of a file of answers, by the `id` of their request.

    Raises:
        InputError: It cannot be read, is too large, a line is no answer, or a request has two.
    """
    answers: dict[str, str] = {}
    with opened(path, "file of answers") as file:
        require(
            os.fstat(file.fileno()).st_size <= LARGEST_ANSWERS_BYTES,
            f"{path}: a file of answers has at most {LARGEST_ANSWERS_BYTES / 1e6:g} MB; answer fewer tracks at a time.",
        )
        for number, line in enumerate(iter(lambda: file.readline(_LONGEST_LINE + 1), b""), start=1):
            place = f"{path}, line {number}"
            require(len(line) <= _LONGEST_LINE, f"{place}: an answer has at most {_LONGEST_LINE:,} bytes.")
            if not line.strip():
                continue
            text = decoded(line, place, "file of answers")
            answer = parse_json(text, place)
            request = answer.fields(("id", "goals"))["id"].text()
            require(request not in answers, f"{place}: a second answer for the request {request[:_HEX]}; keep one.")
            goals_of(answer)
            answers[request] = text
    return answers


def goals_of(document: JsonNode, n: int | None = None) -> Array:
    """The goals of an answer, (n, 4, 4), [m]; `n` is how many it must have, None for any number.

    Raises:
        InputError: It is none.
    """
    poses = document.fields(("goals",), ("id",))["goals"].items("goal", n)
    return np.array([_pose_of(entry) for entry in poses]).reshape(-1, 4, 4)


def _pose_of(node: JsonNode) -> Array:
    said: Mapping[str, JsonNode] = node.fields(("position_mm", "quaternion_wxyz"))
    q = said["quaternion_wxyz"].quaternion()
    return pose.unpack(np.concatenate([said["position_mm"].numbers(3) / _MM, q / np.linalg.norm(q)]))


def _face_form(face: Face | RoundFace) -> dict[str, Any]:
    """A face in the frame of its part: a flat one by a point and its outward normal, a round one by its axis."""
    if isinstance(face, Face):
        return {"kind": "plane", "point_mm": (face.outline.mean(axis=0) * _MM).tolist(), "normal": face.normal.tolist()}
    radii = [radius * _MM for radius in face.radii]
    ends = {"ends_mm": (face.ends * _MM).tolist(), "radii_mm": radii, "hole": face.hole}
    return {"kind": face.kind, "point_mm": (face.point * _MM).tolist(), "axis": face.axis.tolist(), **ends}
