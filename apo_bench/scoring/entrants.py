"""Who enters: a method by name, a program, or a file of answers; the latter two as a small module made for them.

Answers are checked before any trial runs: each request of the tracks needs one.
"""

import hashlib
import json
import shlex
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import check_folders, parse_json, write_file
from apo_bench.names import own_modules_in
from apo_bench.scoring.program import goals_of, read_answers
from apo_bench.scoring.score import score
from apo_bench.scoring.track import Track

_NAME = "corrector"
_MODULE = '"""Made by `apo-bench score`."""\n\nfrom apo_bench.scoring.program import {made}\n\n{name} = {call}\n'
_HEX = 12


@contextmanager
def entrant(
    method: str | None, command: str | None, answers: Path | None, folder: Path, tracks: Sequence[Track], **how: Any
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The method to score, as `module:name` where a program or answers enter, and how; it is found while this lasts.

    Args:
        command: A program with its arguments, as in a shell but started without one, in the current folder.
        answers: A file of JSON lines.
        folder: Where a module may be made.
        how: As for `run_sweep`, and `quick` as for `score`.

    Raises:
        InputError: No such program, or answers that are not those that the tracks need.
        RuntimeError, KeyboardInterrupt: As `run_sweep`, which makes the requests that answers are compared with.
    """
    if method is not None:
        yield method, how
    elif command is not None:
        words = tuple(_words(command))
        program = shutil.which(words[0])
        require(program is not None, f"the program '{words[0]}' was given, which is not found; give its path.")
        with _module(folder, "Program", f"Program({words!r}, {str(Path.cwd())!r})") as name:
            yield name, how
    else:
        assert answers is not None
        given = read_answers(answers)
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as made:
            how["cache"] = Path(made) / "demonstrations"  # which requests and trials have in common
            chosen = _checked(answers, given, _requests(tracks, Path(made), **how))
            kept = _kept(chosen, folder)
            with _module(folder, "Answers", f"Answers({str(kept.resolve())!r})") as name:
                yield name, how


def exported(tracks: Sequence[Track], out: Path, **how: Any) -> int:
    """Write the requests of all trials, JSON lines sorted by `id`, and return how many there are.

    Args:
        how: As for `run_sweep`, and `quick` as for `score`.

    Raises:
        InputError, RuntimeError, KeyboardInterrupt: As `run_sweep`.
    """
    with tempfile.TemporaryDirectory() as made:
        lines = _requests(tracks, Path(made), **how)
    write_file(out, "".join(lines))
    return len(lines)


def _checked(answers: Path, given: Mapping[str, str], requests: Sequence[str]) -> dict[str, str]:
    """The answers to requests, by `id`; each has a pose for each operation."""
    asked = {request["id"]: len(request["operations"]) for request in map(json.loads, requests)}
    missing = [request for request in asked if request not in given]
    require(
        asked and not missing,
        f"{answers} has no answer for {len(missing)} of {len(asked)} requests of the tracks"
        f"{f', such as {missing[0]}' if missing else ''}; answer each line that --export writes for these tracks.",
    )
    for request, operations in asked.items():
        goals_of(parse_json(given[request], f"{answers}, answer to {request}"), operations)
    return {request: given[request] for request in asked}


def _kept(answers: Mapping[str, str], rows: Path) -> Path:
    """A folder of answers, one file each, called by what they are."""
    folder = rows / f".answers-{hashlib.sha256(json.dumps(answers).encode()).hexdigest()[:_HEX]}"
    check_folders([folder])
    folder.mkdir(exist_ok=True)
    for request, line in answers.items():
        write_file(folder / f"{request}.json", line)
    return folder


def _requests(tracks: Sequence[Track], folder: Path, **how: Any) -> list[str]:
    """The requests of all trials, lines of JSON sorted by `id`; a folder holds them meanwhile."""
    requests = folder / "requests"
    requests.mkdir()
    with _module(folder, "Export", f"Export({str(requests)!r})") as name:
        score(name, tracks, folder / "rows", **how)
    return [path.read_text(encoding="utf-8") for path in sorted(requests.iterdir())]


@contextmanager
def _module(folder: Path, made: str, call: str) -> Iterator[str]:
    """A module in a folder, called by what it does, so that the rows of another one are not taken for its own."""
    folder.mkdir(parents=True, exist_ok=True)
    called = f"entrant_{hashlib.sha256(call.encode()).hexdigest()[:_HEX]}"
    path = folder / f"{called}.py"
    write_file(path, _MODULE.format(made=made, name=_NAME, call=call))
    with own_modules_in(str(folder.resolve())):
        yield f"{called}:{_NAME}"


def _words(command: str) -> list[str]:
    """A command line as words."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(f"the command {command!r} was given, which is no command line ({error}).") from error
    require(words, "an empty command was given; name a program.")
    return words
