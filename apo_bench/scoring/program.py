"""Entrants that are no Python: a program that is asked and answers by a line of JSON, or goals out of a file.

A request, `apo-bench/request/1`, is all that a corrector may use: an observation as files have it, with `carries` and
`contacts` (pairs of `part.face`) in each operation, `faces` (`part.face` -> a point and a direction in the frame of the
part, radii where it is round), `fixed` parts, and an `id`. The answer is `{"goals": [pose, ...]}`, one pose
(`position_mm`, `quaternion_wxyz`) for each operation.
"""

import hashlib
import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, require
from apo_bench.files.json_forms import observation_form
from apo_bench.geometry import Array, Face, RoundFace, pose
from apo_bench.io import JsonNode, decoded, parse_json, read_text, write_file

REQUEST = "apo-bench/request/1"
_HEX = 32
_MM = 1e3


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
        line = request_line(observation)
        try:
            done = subprocess.run(
                self.command, input=f"{line}\n".encode(), stdout=subprocess.PIPE, cwd=self.folder, check=False
            )
        except OSError as error:
            raise InputError(f"the program '{self.command[0]}' cannot be run ({error}).") from error
        answer = f"the answer of '{self.command[0]}'"
        require(done.returncode == 0, f"the program '{self.command[0]}' ended with exit code {done.returncode}.")
        require(done.stdout.strip(), f"the program '{self.command[0]}' wrote no answer; one line of JSON is needed.")
        return goals_of(parse_json(decoded(done.stdout, answer, "JSON"), answer), len(observation.goals))


@final
@dataclass(frozen=True)
class Answers:
    """A corrector whose goals stand in a file: JSON lines with `id` and `goals`."""

    path: str

    def __call__(self, observation: Observation) -> Array:
        """The goals that the file has for this observation, (n, 4, 4), [m].

        Raises:
            InputError: It has none.
        """
        asked = json.loads(request_line(observation))["id"]
        for number, line in enumerate(read_text(self.path, "answers").splitlines(), start=1):
            if asked in line:
                document = parse_json(line, f"{Path(self.path).name}, line {number}")
                if isinstance(document.value, dict) and document.value.get("id") == asked:
                    return goals_of(document, len(observation.goals))
        raise InputError(
            f"{Path(self.path).name} has no answer for the request {asked}; answer every line of the export."
        )


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


def goals_of(document: JsonNode, n: int) -> Array:
    """The goals of an answer, (n, 4, 4), [m].

    Raises:
        InputError: It is none.
    """
    poses = document.fields(("goals",), ("id",))["goals"].items("goal", n)
    return np.array([_pose_of(entry) for entry in poses]).reshape(n, 4, 4)


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
