"""Goals that were made elsewhere: requests go out as files, and answers come back as JSON lines."""

import json
from functools import lru_cache
from pathlib import Path

from apo_bench.assembly import Observation
from apo_bench.benchmark.scoring.program import parse_answer, request_line
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import read_text, write_file

LARGEST_ANSWERS_BYTES = 256_000_000
"""Those for all tracks have 3 MB."""


def write_request(folder: str, observation: Observation) -> Array:
    """Write a request into a folder; as a corrector, it makes no goals.

    Raises:
        InputError: Always, when the request was written.
    """
    line = request_line(observation)
    write_file(Path(folder) / f"{json.loads(line)['id']}.json", line + "\n")
    raise InputError("the request was written, and nothing was corrected.")


def find_answer(path: str, observation: Observation) -> Array:
    """The goals that a file of answers has for an observation, (n, 4, 4), [m].

    Raises:
        InputError: It has none.
    """
    answers = read_answers(Path(path))
    request = json.loads(request_line(observation))["id"]
    require(request in answers, f"{path} has no answer for the request {request}.")
    return answers[request]


@lru_cache(maxsize=1)
def read_answers(path: Path) -> dict[str, Array]:
    """The goals in a file of answers, (n, 4, 4) each, by the `id` of their request.

    Raises:
        InputError: It cannot be read, is too large, a line is no answer, or a request has two.
    """
    answers: dict[str, Array] = {}
    text = read_text(path, "file of answers", LARGEST_ANSWERS_BYTES)
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            request, poses = parse_answer(line, f"{path}, line {number}")
            require(request not in answers, f"{path}, line {number}: a second answer for {request}; keep one.")
            answers[request] = poses
    return answers
