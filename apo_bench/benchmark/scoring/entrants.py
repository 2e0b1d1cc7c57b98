"""Who enters: a method by name, a program, or a file of answers; the latter two as a small module made for them."""

import hashlib
import json
import shlex
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apo_bench.benchmark.scoring.answers import read_answers
from apo_bench.benchmark.scoring.score import score
from apo_bench.benchmark.scoring.track import Track
from apo_bench.errors import InputError, require
from apo_bench.io import write_file
from apo_bench.names import own_modules_in

_MODULE = """
'''Made by `apo-bench score`.'''

from functools import partial

from apo_bench.benchmark.scoring.{place} import {made}

corrector = partial({made}, {given})
"""
_HEX = 12


@contextmanager
def entrant(
    method: str | None, command: str | None, answers: Path | None, folder: Path, tracks: Sequence[Track], **how: Any
) -> Iterator[str]:
    """The method to score, as `module:name` where a program or answers enter; it is found while this lasts.

    Args:
        command: A program with its arguments, as in a shell but started without one, in the current folder.
        answers: A file of JSON lines; each request of the tracks needs one, before any trial runs.
        folder: Where a module may be made.
        how: As for `run_sweep`, and `quick` as for `score`.

    Raises:
        InputError: No such program, or answers that are not those that the tracks need.
        RuntimeError, KeyboardInterrupt: As `run_sweep`, which makes the requests that answers are compared with.
    """
    if method is not None:
        yield method
    elif command is not None:
        words = _words(command)
        with _module(folder, "program", "ask_program", f"{words!r}, {str(Path.cwd())!r}") as name:
            yield name
    else:
        assert answers is not None
        _check_answers(answers, tracks, **how)
        identity = hashlib.sha256(answers.read_bytes()).hexdigest()
        with _module(folder, "answers", "find_answer", repr(str(answers.resolve())), identity) as name:
            yield name


def exported(tracks: Sequence[Track], out: Path, **how: Any) -> int:
    """Write the requests of all trials, JSON lines sorted by `id`, and return how many there are.

    Args:
        how: As for `run_sweep`, and `quick` as for `score`.

    Raises:
        InputError, RuntimeError, KeyboardInterrupt: As `run_sweep`.
    """
    lines = _requests(tracks, **how)
    write_file(out, "".join(lines))
    return len(lines)


def _check_answers(path: Path, tracks: Sequence[Track], **how: Any) -> None:
    """Raise an `InputError` unless each request of the tracks has an answer, with a pose for each operation."""
    read_answers.cache_clear()  # the file may have been another one before
    answers = read_answers(path)
    asked = {request["id"]: len(request["operations"]) for request in map(json.loads, _requests(tracks, **how))}
    missing = [request for request in asked if request not in answers]
    require(
        asked and not missing,
        f"{path} has no answer for {len(missing)} of {len(asked)} requests of the tracks"
        f"{f', such as {missing[0]}' if missing else ''}; answer each line that --export writes for these tracks.",
    )
    for request, operations in asked.items():
        given = len(answers[request])
        require(given == operations, f"{path}, answer to {request}: {operations} goals are needed, {given} were given.")


def _requests(tracks: Sequence[Track], **how: Any) -> list[str]:
    """The requests of all trials, lines of JSON sorted by `id`."""
    with tempfile.TemporaryDirectory() as made:
        requests = Path(made) / "requests"
        requests.mkdir()
        with _module(Path(made), "answers", "write_request", repr(str(requests))) as name:
            score(name, tracks, Path(made) / "rows", **how)
        return [path.read_text(encoding="utf-8") for path in sorted(requests.iterdir())]


@contextmanager
def _module(folder: Path, place: str, made: str, given: str, identity: str = "") -> Iterator[str]:
    """A module in a folder, called by what it does, so that the rows of another one are not taken for its own.

    Args:
        place, made, given: The module and the function of its corrector, and what that is given first.
        identity: What else tells it from others.
    """
    text = _MODULE.format(place=place, made=made, given=given)
    called = f"entrant_{hashlib.sha256(f'{text}{identity}'.encode()).hexdigest()[:_HEX]}"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{called}.py"
    write_file(path, text)
    with own_modules_in(str(folder.resolve())):
        yield f"{called}:corrector"


def _words(command: str) -> tuple[str, ...]:
    """A command line as words, the first of which is a program."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(f"the command {command!r} was given, which is no command line ({error}).") from error
    require(words, "an empty command was given; name a program.")
    program = shutil.which(words[0])
    require(program is not None, f"the program '{words[0]}' was given, which is not found; give its path.")
    return tuple(words)
