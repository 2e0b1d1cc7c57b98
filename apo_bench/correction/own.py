"""Correctors of one's own, named as `module:name`: each module in a process that is given observations, nothing else.

What comes back is read as data and checked here; whatever a corrector does to its process, it has done to a fork of it.
"""

from __future__ import annotations

import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from multiprocessing import connection
from typing import Any, final

from apo_bench.correction.correct import Misbehaved, checked_corrector, correct
from apo_bench.correction.forms import observation_message, read_correction
from apo_bench.correction.message import Arrays, Form, Garbled, Message, receive, send
from apo_bench.correction.server import NOTICE
from apo_bench.errors import InputError
from apo_bench.processes import descendants, end_descendants
from apo_bench.program import Correction, Observation

LIMIT_S = 120.0
"""What one correction may take."""
STARTING_S = 120.0
"""What a module may take to be imported."""
NOTICE_S = 2.0
"""How long a fork may be gone before that is said."""
LONGEST_S = 1e6
LONGEST_SENTENCE = 2000
START = (
    "import sys; fd, module, fork, *sys.path = sys.argv[1:]; sys.argv[1:] = []; "
    "from apo_bench.correction.server import main; main(int(fd), module, fork == 'True')"
)


@final
class Lost(Misbehaved):
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

    def __init__(self, limit_s: float = LIMIT_S) -> None:
        """Args:
        limit_s: Wall time that a correction may take.
        """
        if not (math.isfinite(limit_s) and 0.0 < limit_s <= LONGEST_S):
            raise InputError(
                f"a limit of {limit_s:g} s per correction was given; a number above 0 and up to {LONGEST_S:g} is "
                "allowed."
            )
        self._limit_s = limit_s
        self._servers: dict[str, Server] = {}
        self._found: dict[str, OwnCorrector] = {}
        self.files: set[str] = set()
        """Of the modules that were imported, as they say themselves."""

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
                self._servers[module] = Server(module)
            found = OwnCorrector(method, self._servers[module], self._limit_s)
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


def is_own(method: Any) -> bool:
    """Whether it is named as `module:name`."""
    return isinstance(method, str) and ":" in method


def correct_named(seen: Observation, corrector: Any) -> Correction:
    """As `correct`, but what is named as `module:name` runs in a process of its own.

    Raises:
        InputError: As `correct`.
    """
    with OwnCorrectors() as own:
        return correct(seen, own.find(corrector))


def check_correctors(methods: Iterable[str], limit_s: float = LIMIT_S) -> set[str]:
    """Raise an `InputError` unless all of these can be had: `oracle`, `none`, correctors by name or `module:name`.

    Returns:
        The files of the modules that those of one's own bring in.
    """
    with OwnCorrectors(limit_s) as own:
        for method in methods:
            if own.find(method) == method and method not in ("oracle", "none"):
                checked_corrector(method)
        return own.files


@final
class OwnCorrector:
    """Stands for a function in another process: `Observation -> Correction`."""

    def __init__(self, name: str, server: Server, limit_s: float) -> None:
        self.__name__, self.__module__ = name, name.partition(":")[0]
        self._server, self._limit_s = server, limit_s

    def __call__(self, seen: Observation) -> Correction:
        """Ask it.

        Raises:
            Misbehaved: It raised an error or returned what it must not; or, as `Lost`, it ended its process or took
                too long.
        """
        said, numbers = self._asked("correct", *observation_message(seen), self._limit_s)
        if "raised" in said:
            raise Misbehaved(_line(said["raised"]))
        try:
            return read_correction(said, numbers)
        except Garbled as error:
            raise Misbehaved(f"the corrector '{self.__name__}' sent back what is no correction.") from error

    def check(self) -> list[str]:
        """The files of the modules that it brought in.

        Raises:
            InputError: It cannot be imported, or is no function.
        """
        try:
            said, _ = self._asked("check", {}, {}, STARTING_S)
        except Misbehaved as error:
            raise InputError(f"{str(error).rstrip('.')} while it was imported; mend it, or use another.") from error
        if "raised" in said:
            raise InputError(_line(said["raised"]))
        files = said.get("files")
        return [path for path in files if isinstance(path, str)] if isinstance(files, list) else []

    def _asked(self, what: str, form: Form, arrays: Arrays, limit_s: float) -> Message:
        name = f"the corrector '{self.__name__}'"
        try:
            return self._server.ask({**form, "asked": what, "name": self.__name__}, arrays, limit_s)
        except TimeoutError as error:
            raise Lost("time_limit", f"{name} took longer than {limit_s:g} s.") from error
        except (EOFError, OSError) as error:
            raise Lost("worker_died", f"{name} ended its process{_how(error)}.") from error
        except Garbled as error:
            raise Misbehaved(f"{name} sent back what cannot be read.") from error


@final
class Server:
    """The process of a module, as the one who asks sees it; started when it is needed."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._asked = 0
        self._code: int | None = None
        """With which the fork of the last request has ended, if it has said so."""
        self._helpers: Iterable[int] = ()
        """Processes that importing the module has started."""

    def ask(self, form: Form, arrays: Arrays, limit_s: float) -> Message:
        """What a fork of it answers.

        Raises:
            TimeoutError: Nothing, in that time.
            EOFError, OSError: It ended before.
            Garbled: What it sent is no message.
        """
        process, control = self._running()
        here, there = _pair()
        deadline = time.monotonic() + limit_s
        self._asked, self._code = self._asked + 1, None
        whole = False
        try:
            with here:
                with there:
                    socket.send_fds(control, [b"?"], [there.fileno()])
                send(here, form, arrays, deadline)
                said = receive(here, lambda: self._wait(here, deadline))
            whole = True
            return said
        except (EOFError, ConnectionError) as error:
            code = self._exit_code()
            whole = code is not None
            raise EOFError(code) from error
        finally:
            if whole and can_fork():
                end_descendants(process.pid, (*self._helpers,))
            else:
                self.end()

    def end(self) -> None:
        """End it with all that it started."""
        if self._process is None or self._control is None:
            return
        end_descendants(self._process.pid)
        with suppress(OSError):
            os.killpg(self._process.pid, 9)
        self._process.kill()
        self._process.wait()
        self._control.close()
        self._process = self._control = None

    def _running(self) -> tuple[subprocess.Popen[bytes], socket.socket]:
        if self._process is None or self._control is None:
            self._start()
        assert self._process is not None
        assert self._control is not None
        return self._process, self._control

    def _start(self) -> None:
        """A new interpreter: nothing of this process is in its memory."""
        if not hasattr(socket, "send_fds"):
            raise InputError(
                f"a corrector out of the module '{self._module}' was named, which this system cannot run in a process "
                "of its own; use Linux or macOS, or hand the function over in Python (apo_bench.correct)."
            )
        self._control, theirs = _pair()
        where = None if _is_open(2) else subprocess.DEVNULL
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", START, str(theirs.fileno()), self._module, str(can_fork()), *sys.path],
                stdin=subprocess.DEVNULL,
                stdout=2 if where is None else where,
                stderr=where,
                pass_fds=[theirs.fileno()],
                process_group=0,
            )
        self._asked = 0
        self._control.settimeout(STARTING_S)
        try:
            if not self._control.recv(NOTICE.size):
                raise EOFError("it ended before it was ready")
        except BaseException:
            self.end()
            raise
        self._helpers = descendants(self._process.pid)

    def _wait(self, here: socket.socket, deadline: float) -> None:
        """Until there is something to read, or the fork has ended without a word."""
        assert self._control is not None
        while (left := deadline - time.monotonic()) > 0.0:
            ready = connection.wait([here, self._control], left)
            if here in ready:
                return
            if ready and self._note() and not connection.wait([here], 0.0):
                raise EOFError("the fork ended without a word")
        raise TimeoutError("the time is up")

    def _note(self) -> bool:
        """Read a notice that has come; whether the fork of this request has ended."""
        assert self._control is not None
        notice = self._control.recv(NOTICE.size)
        if len(notice) < NOTICE.size:
            raise EOFError("the process of the module ended")
        number, code = NOTICE.unpack(notice)
        if number == self._asked:
            self._code = code
        return self._code is not None

    def _exit_code(self) -> int | None:
        """Of the fork that is gone; None if the process of the module is gone too, or does not say."""
        deadline, control = time.monotonic() + NOTICE_S, self._control
        assert control is not None
        try:
            while self._code is None and connection.wait([control], max(0.0, deadline - time.monotonic())):
                self._note()
        except (EOFError, OSError):
            return None
        return self._code


def can_fork() -> bool:
    """Whether a process may fork: where system libraries survive it, and what a fork leaves behind is found again."""
    return sys.platform == "linux"


def _pair() -> tuple[socket.socket, socket.socket]:
    """Two ends whose descriptors are none of the three that every program has, closed as those may be."""
    import fcntl

    ends = []
    for end in socket.socketpair():
        with end:
            ends.append(socket.socket(fileno=fcntl.fcntl(end.fileno(), fcntl.F_DUPFD_CLOEXEC, 3)))
    return ends[0], ends[1]


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def _how(error: BaseException) -> str:
    """` with exit code 3`, ` by signal 9`, or nothing."""
    code = error.args[0] if isinstance(error, EOFError) and error.args else None
    if not isinstance(code, int):
        return ""
    return f" with exit code {code}" if code >= 0 else f" by signal {-code}"


def _line(said: Any) -> str:
    """One line that can be printed, whatever came."""
    return "".join(c if c.isprintable() else " " for c in str(said)[:LONGEST_SENTENCE])
