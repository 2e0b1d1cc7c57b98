"""Who enters: a method by name, a program, or a file of answers; the latter two as a small module made for them."""

import hashlib
import shlex
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.io import read_bytes, write_file
from apo_bench.names import own_modules_in
from apo_bench.scoring.score import score
from apo_bench.scoring.track import Track

_NAME = "corrector"
_MODULE = '"""Made by `apo-bench score`."""\n\nfrom apo_bench.scoring.program import {made}\n\n{name} = {call}\n'
_HEX = 12


@contextmanager
def entrant(method: str | None, command: str | None, answers: Path | None, folder: Path) -> Iterator[str]:
    """The method to score, as `module:name` where a program or answers enter; it is found while this lasts.

    Args:
        command: A program with its arguments, as in a shell but started without one, in the current folder.
        answers: A file of JSON lines.
        folder: Where a module may be made.

    Raises:
        InputError: No such program or file.
    """
    if method is not None:
        yield method
    elif command is not None:
        words = tuple(_words(command))
        program = shutil.which(words[0])
        require(program is not None, f"the program '{words[0]}' was given, which is not found; give its path.")
        with _module(folder, "Program", f"Program({words!r}, {str(Path.cwd())!r})", b"") as name:
            yield name
    else:
        assert answers is not None
        content = read_bytes(answers, "answers")
        with _module(folder, "Answers", f"Answers({str(answers.resolve())!r})", content) as name:
            yield name


def exported(tracks: Sequence[Track], out: Path, *, quick: bool, **how: Any) -> int:
    """Write the requests of all trials, JSON lines sorted by `id`, and return how many there are.

    Args:
        how: As for `run_sweep`.

    Raises:
        InputError, RuntimeError, KeyboardInterrupt: As `run_sweep`.
    """
    with tempfile.TemporaryDirectory() as made:
        requests = Path(made) / "requests"
        requests.mkdir()
        with _module(Path(made), "Export", f"Export({str(requests)!r})", b"") as name:
            score(name, tracks, Path(made) / "rows", quick=quick, **how)
        lines = [path.read_text(encoding="utf-8") for path in sorted(requests.iterdir())]
    write_file(out, "".join(lines))
    return len(lines)


@contextmanager
def _module(folder: Path, made: str, call: str, content: bytes) -> Iterator[str]:
    """A module in a folder, called by what it does, so that the rows of another one are not taken for its own."""
    folder.mkdir(parents=True, exist_ok=True)
    called = f"entrant_{hashlib.sha256(call.encode() + content).hexdigest()[:_HEX]}"
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
