"""The process of a module of one's own, as the one who asks sees it."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from multiprocessing import connection
from typing import final

from apo_bench.correction.own_code.forms import Arrays, CorrectorMessage, MessageForm, receive, send
from apo_bench.correction.own_code.server import NOTICE
from apo_bench.errors import require
from apo_bench.io import descendants, end_descendants
from apo_bench.names import folder_of_own_modules

_NOTICE_S = 2.0
"""How long a fork may be gone before that is said."""
_START = (
    "import sys; fd, module, fork, folder, *sys.path = sys.argv[1:]; sys.argv[1:] = []; "
    "from apo_bench.correction.own_code.server import answer_requests; "
    "answer_requests(int(fd), module, fork == 'True', folder)"
)


@final
class Server:
    """Started when it is needed."""

    def __init__(self, module: str, starting_s: float) -> None:
        """Args:
        starting_s: Wall time that importing the module may take.
        """
        self._module = module
        self.starting_s = starting_s
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._asked = 0
        self._code: int | None = None
        """With which the fork of the last request has ended, if it has said so."""
        self._helpers: Iterable[int] = ()
        """Processes that importing the module has started."""

    def ask(self, form: MessageForm, arrays: Arrays, limit_s: float) -> CorrectorMessage:
        """What a fork of it answers.

        Raises:
            TimeoutError: Nothing, in that time.
            EOFError, OSError: It ended before.
            GarbledMessage: What it sent is no message.
        """
        process, control = self._running()
        here, there = _pair()
        deadline = time.monotonic() + limit_s
        self._asked = self._asked + 1
        self._code = None
        whole = False
        try:
            with here:
                with there:
                    socket.send_fds(control, [b"?"], [there.fileno()])
                send(here, form, arrays, deadline)
                answer = receive(here, lambda: self._wait(here, deadline))
            whole = True
            return answer
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
            os.killpg(self._process.pid, signal.SIGKILL)
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
        require(
            hasattr(socket, "send_fds"),
            f"a corrector out of the module '{self._module}' was named, which this system cannot run in a process "
            "of its own; use Linux or macOS, or hand the function over in Python (apo_bench.correct).",
        )
        self._control, theirs = _pair()
        where = None if _is_open(2) else subprocess.DEVNULL
        with theirs:
            said = (str(theirs.fileno()), self._module, str(can_fork()), folder_of_own_modules())
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, *said, *sys.path],
                stdin=subprocess.DEVNULL,
                stdout=2 if where is None else where,
                stderr=where,
                pass_fds=[theirs.fileno()],
                process_group=0,
            )
        self._asked = 0
        self._control.settimeout(self.starting_s)
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
        """The exit code of the fork that is gone; None if the process of the module is gone too, or does not say."""
        deadline = time.monotonic() + _NOTICE_S
        control = self._control
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
