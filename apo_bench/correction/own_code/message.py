"""What goes between a corrector's process and ours: JSON and numbers, nothing that could be code.

    length of the JSON and of the numbers (4 bytes each, big-endian) | JSON, UTF-8 | numbers, array after array

The JSON says type and shape of every array under `arrays`.
"""

import json
import math
import socket
import struct
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

FRAME_HEADER = struct.Struct("!II")
_TYPES = ("float64", "bool")
_LARGEST_JSON = 1 << 24
_LARGEST_NUMBERS = 1 << 26
"""Bytes; beyond, nothing is read."""
_CHUNK = 1 << 20

MessageForm = dict[str, Any]
Arrays = Mapping[str, NDArray]
CorrectorMessage = tuple[MessageForm, Arrays]
_Wait = Callable[[], None]
"""Returns when there is something to read; raises if there never will be."""


class GarbledMessage(ValueError):
    """What came is no such message."""


def send(to: socket.socket, form: MessageForm, arrays: Arrays, deadline: float = math.inf) -> None:
    """Send one message.

    Args:
        deadline: On the monotonic clock, [s].

    Raises:
        TimeoutError: The other side does not read.
        OSError: There is no other side.
    """
    stated = {name: [str(array.dtype), list(array.shape)] for name, array in arrays.items()}
    text = json.dumps({**form, "arrays": stated}).encode()
    numbers = b"".join(array.tobytes() for array in arrays.values())
    left = memoryview(FRAME_HEADER.pack(len(text), len(numbers)) + text + numbers)
    while left:
        to.settimeout(_remaining(deadline))
        left = left[to.send(left) :]


def receive(of: socket.socket, wait: _Wait = lambda: None) -> CorrectorMessage:
    """Read one message.

    Args:
        wait: Called before each piece is read.

    Raises:
        GarbledMessage: It is none.
        EOFError: It ends in the middle, or does not begin.
    """
    of.settimeout(None)
    size, length = FRAME_HEADER.unpack(_read(of, FRAME_HEADER.size, wait))
    if size > _LARGEST_JSON or length > _LARGEST_NUMBERS:
        raise GarbledMessage("the message is too large")
    text = _read(of, size, wait)
    numbers = _read(of, length, wait)
    try:
        form = json.loads(text)
        return form, _arrays(form.pop("arrays"), numbers)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise GarbledMessage("the message cannot be read") from error


def _arrays(stated: Mapping[str, Any], numbers: bytes) -> Arrays:
    arrays = {}
    at = 0
    for name, (kind, shape) in stated.items():
        if kind not in _TYPES or not all(type(size) is int and size >= 0 for size in shape):
            raise GarbledMessage("an array of another type")
        count = math.prod(shape)
        if count > _LARGEST_NUMBERS:
            raise GarbledMessage("an array that is too large")
        arrays[name] = np.frombuffer(numbers, np.dtype(kind), count, at).reshape(shape)
        at += arrays[name].nbytes
    if at != len(numbers):
        raise GarbledMessage("numbers that belong to no array")
    return arrays


def _read(of: socket.socket, size: int, wait: _Wait) -> bytes:
    read = bytearray()
    while len(read) < size:
        wait()
        piece = of.recv(min(size - len(read), _CHUNK))
        if not piece:
            raise EOFError("the other side is gone")
        read += piece
    return bytes(read)


def _remaining(deadline: float) -> float | None:
    if deadline == math.inf:
        return None
    left = deadline - time.monotonic()
    if left <= 0.0:
        raise TimeoutError("the time is up")
    return left
