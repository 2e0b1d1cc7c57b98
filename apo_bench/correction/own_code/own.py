"""Correctors of one's own, named as `module:name`: each module in a process that is given observations, nothing else.

What comes back is read as data and checked here; whatever a corrector does to its process, it has done to a fork of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, final

from apo_bench.assembly import Correction, Look, Observation
from apo_bench.correction.correctors import CorrectorMisbehaved, checked_corrector, correct
from apo_bench.correction.own_code.forms import (
    Arrays,
    CorrectorMessage,
    GarbledMessage,
    MessageForm,
    observation_message,
    parse_correction,
)
from apo_bench.correction.own_code.process import Server
from apo_bench.errors import InputError, require
from apo_bench.records import CORRECTOR_LIMIT_S, UNCORRECTED, is_own

LEAST_STARTING_S = 30.0
"""What importing a module may take at least: a new interpreter, and libraries that are large."""
_LONGEST_S = 1e6
_LONGEST_SENTENCE = 2000


@final
class CorrectorLost(CorrectorMisbehaved):
    """A corrector ended its process, or took too long."""

    def __init__(self, code: str, sentence: str) -> None:
        """Args:
        code: `worker_died` or `time_limit`.
        """
        super().__init__(sentence)
        self.code = code


@final
class OwnCorrectors:
    """Finds correctors by name; a context manager that ends their processes."""

    def __init__(self, limit_s: float = CORRECTOR_LIMIT_S) -> None:
        """Args:
        limit_s: Wall time that a correction may take; importing its module may take the same, or 30 s if that is
                more.
        """
        require(
            math.isfinite(limit_s) and 0.0 < limit_s <= _LONGEST_S,
            f"a limit of {limit_s:g} s per correction was given; a number above 0 and up to {_LONGEST_S:g} is allowed.",
        )
        self._limit_s = limit_s
        self._servers: dict[str, Server] = {}
        self._found: dict[str, _OwnCorrector] = {}
        self.files: set[str] = set()
        """The files of the modules that were imported, as these say themselves."""

    def find(self, method: Any) -> Any:
        """What to pass to `correct`: a stand-in for what is named as `module:name`, anything else as it is.

        Raises:
            InputError: It cannot be imported, or is no function.
        """
        if not is_own(method):
            return method
        if method not in self._found:
            module = method.partition(":")[0]
            if module not in self._servers:
                self._servers[module] = Server(module, max(self._limit_s, LEAST_STARTING_S))
            found = _OwnCorrector(method, self._servers[module], self._limit_s)
            self.files.update(found.check())
            self._found[method] = found
        return self._found[method]

    def close(self) -> None:
        """End all processes."""
        for server in self._servers.values():
            server.end()
        self._servers.clear()
        self._found.clear()

    def __enter__(self) -> OwnCorrectors:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def correct_named(observation: Observation, corrector: Any, look: Look | None = None) -> Correction:
    """Correct an observation; a corrector named as `module:name` runs in a process of its own, and cannot look again.

    Raises:
        InputError: There is no such corrector, or the observation makes no sense.
    """
    with OwnCorrectors() as own:
        return correct(observation, own.find(corrector), look)


def check_correctors(methods: Iterable[str], limit_s: float = CORRECTOR_LIMIT_S) -> set[str]:
    """Raise an `InputError` unless all of these can be had: plans without one, correctors by name or `module:name`.

    Returns:
        The files of the modules that those of one's own bring in.
    """
    with OwnCorrectors(limit_s) as own:
        for method in methods:
            if own.find(method) == method and method not in UNCORRECTED:
                checked_corrector(method)
        return own.files


@final
class _OwnCorrector:
    """Stands for a function in another process: `Observation -> Correction`."""

    def __init__(self, name: str, server: Server, limit_s: float) -> None:
        self.__name__ = name
        self.__module__ = name.partition(":")[0]
        self._server = server
        self._limit_s = limit_s

    def __call__(self, observation: Observation) -> Correction:
        """Ask it.

        Raises:
            CorrectorMisbehaved: It raised an error or returned what it must not; or, as `CorrectorLost`, it ended its
                process or took too long.
        """
        answer, numbers = self._asked("correct", *observation_message(observation), self._limit_s)
        if "raised" in answer:
            raise CorrectorMisbehaved(_line(answer["raised"]))
        try:
            return parse_correction(answer, numbers)
        except GarbledMessage as error:
            raise CorrectorMisbehaved(f"the corrector '{self.__name__}' sent back what is no correction.") from error

    def check(self) -> list[str]:
        """The files of the modules that it brought in.

        Raises:
            InputError: It cannot be imported, or is no function.
        """
        try:
            answer, _ = self._asked("check", {}, {}, self._server.starting_s)
        except CorrectorMisbehaved as error:
            raise InputError(f"{str(error).rstrip('.')} while it was imported; mend it, or use another.") from error
        if "raised" in answer:
            raise InputError(_line(answer["raised"]))
        files = answer.get("files")
        return [path for path in files if isinstance(path, str)] if isinstance(files, list) else []

    def _asked(self, what: str, form: MessageForm, arrays: Arrays, limit_s: float) -> CorrectorMessage:
        name = f"the corrector '{self.__name__}'"
        try:
            return self._server.ask({**form, "asked": what, "name": self.__name__}, arrays, limit_s)
        except TimeoutError as error:
            raise CorrectorLost("time_limit", f"{name} took longer than {limit_s:g} s.") from error
        except (EOFError, OSError) as error:
            raise CorrectorLost("worker_died", f"{name} ended its process{_how(error)}.") from error
        except GarbledMessage as error:
            raise CorrectorMisbehaved(f"{name} sent back what cannot be read.") from error


def _how(error: BaseException) -> str:
    """` with exit code 3`, ` by signal 9`, or nothing."""
    code = error.args[0] if isinstance(error, EOFError) and error.args else None
    if not isinstance(code, int):
        return ""
    return f" with exit code {code}" if code >= 0 else f" by signal {-code}"


def _line(answer: Any) -> str:
    """One line that can be printed, whatever came."""
    return "".join(c if c.isprintable() else " " for c in str(answer)[:_LONGEST_SENTENCE])
