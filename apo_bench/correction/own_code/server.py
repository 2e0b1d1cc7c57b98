"""The process in which a corrector of one's own lives: it imports the module once, and each request has a fork of that.

Started by `own_process` as a new interpreter that knows nothing but the name of the module. A request comes as one end
of a socket of its own; this process never reads it, so that no fork finds what another was asked. Standard output is
standard error here, and whatever a fork leaves behind is ended.
"""

import ctypes
import os
import resource
import select
import signal
import socket
import struct
import sys
from contextlib import suppress
from importlib import import_module

from apo_bench.correction.correctors import checked_corrector, correct
from apo_bench.correction.own_code.forms import (
    Arrays,
    CorrectorMessage,
    MessageForm,
    correction_message,
    parse_observation,
    receive,
    send,
)
from apo_bench.errors import InputError
from apo_bench.io import end_descendants, flush
from apo_bench.names import admit, own_modules_in

NOTICE = struct.Struct("!Ii")
"""To the process that asks: how many requests there were, and the exit code of the one that ended; first 0, 0."""
_TURN_S = 0.02
_DEATH_SIGNAL = 1
_SUBREAPER = 36
"""Two options of `prctl`, on Linux."""
_LARGEST_FILE = 1 << 30
"""Bytes; also of a file that standard error goes to, so that endless output does not fill the disk."""
_LIKELIEST = "1000"
"""Where memory runs out, this goes first."""
_USUAL = "scipy.special"
"""What the solvers of the package import when they are first used: better once than in every fork."""
_IGNORED = ("SIGINT", "SIGTERM", "SIGHUP")
"""For the process that asks, which ends this one."""


def answer_requests(control: int, module: str, fork: bool, folder: str = "") -> None:
    """The life of the process.

    Args:
        control: File descriptor of a socket on which requests come.
        module: To be imported first; what that raises is said in answer to requests.
        fork: Whether every request has a fork; else it does one request.
        folder: Where the module may lie besides the path of this process; empty for nowhere.
    """
    for name in _IGNORED:
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    _prctl(_SUBREAPER, 1)
    with suppress(OSError), open("/proc/self/oom_score_adj", "w") as file:
        file.write(_LIKELIEST)
    for what, most in ((resource.RLIMIT_FSIZE, _LARGEST_FILE), (resource.RLIMIT_CORE, 0)):
        with suppress(OSError, ValueError):
            resource.setrlimit(what, (most, most))
    import_module(_USUAL)
    _prctl(_DEATH_SIGNAL, signal.SIGKILL)
    with own_modules_in(folder):
        admit(module)
        with suppress(BaseException):
            import_module(module)
        flush()
        _prctl(_DEATH_SIGNAL, 0)
        with socket.socket(fileno=control) as asking:
            _serve(asking, fork)
    end_descendants(os.getpid())
    os.killpg(0, signal.SIGKILL)


def _answer(request: socket.socket) -> None:
    """Read one request, do it, say what came of it."""
    form, arrays = receive(request)
    own = os.getpid()
    answer, numbers = _said(form, arrays)
    flush()
    if os.getpid() == own:  # the corrector may have forked and come back from both
        send(request, answer, numbers)


def _serve(asking: socket.socket, fork: bool) -> None:
    """Do request after request, until nobody asks."""
    number = 0
    child = 0
    with suppress(OSError):
        asking.send(NOTICE.pack(0, 0))
        while True:
            ready, _, _ = select.select([asking], [], [], _TURN_S if child else None)
            for pid, status in _ended():
                if pid == child:
                    asking.send(NOTICE.pack(number, os.waitstatus_to_exitcode(status)))
                    child = 0
            if not ready:
                continue
            word, descriptors, _, _ = socket.recv_fds(asking, 1, 1)
            if not word:
                return
            number += 1
            child = os.fork() if fork else 0
            if child == 0:
                if fork:
                    _prctl(_DEATH_SIGNAL, signal.SIGKILL)
                    asking.close()
                _do(descriptors[0])
            os.close(descriptors[0])


def _do(descriptor: int) -> None:
    """Do a request and end."""
    with suppress(BaseException), socket.socket(fileno=descriptor) as request:
        _answer(request)
        os._exit(0)
    os._exit(1)


def _said(form: MessageForm, arrays: Arrays) -> CorrectorMessage:
    """What was asked for, or why there is none."""
    name = form["name"]
    try:
        if form["asked"] == "check":
            checked_corrector(name)
            return {"files": _files()}, {}
        return correction_message(correct(parse_observation(form, arrays), name))
    except InputError as error:
        return {"raised": str(error)}, {}
    except BaseException as error:
        return {"raised": f"the corrector '{name}' raised {type(error).__name__}({_text(error)})."}, {}


def _text(error: BaseException) -> str:
    with suppress(Exception):
        return " ".join(str(error).split())
    return ""


def _files() -> list[str]:
    """The files of all modules that importing the corrector brought in."""
    paths = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    return [path for path in paths if isinstance(path, str)]


def _ended() -> list[tuple[int, int]]:
    """Children that have ended, and how."""
    ended = []
    with suppress(ChildProcessError):
        while (pair := os.waitpid(-1, os.WNOHANG))[0]:
            ended.append(pair)
    return ended


def _prctl(what: int, value: int) -> None:
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(what, value, 0, 0, 0)
