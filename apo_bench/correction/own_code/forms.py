"""Observations and corrections as messages, and back; what comes back may have been made by anybody.

What goes between a corrector's process and ours: JSON and numbers, nothing that could be code.

    length of the JSON and of the numbers (4 bytes each, big-endian) | JSON, UTF-8 | numbers, array after array

The JSON says type and shape of every array under `arrays`.
"""

import json
import math
import socket
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import (
    Assembly,
    Consistency,
    Contact,
    Correction,
    Gap,
    Iterate,
    Observation,
    Operation,
    OutlierModel,
    SharedError,
    Step,
    Tails,
    Try,
)
from apo_bench.geometry import Box, Cylinder, Face, Hull, Piece, RoundFace, Solid

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


class _CorrectionForm(msgspec.Struct):
    """What of a correction is no array of many numbers; fields as it has them."""

    status: str
    sentence: str
    freed: tuple[int, ...]
    gap_before_m: float
    gap_after_m: float
    rank: int
    trace: tuple[Iterate, ...]
    tried: tuple[Try, ...]
    schedule: tuple[tuple[int, bool], ...]
    test: Consistency | None
    test_after: Consistency | None
    dropped: tuple[str, ...]
    left_out: tuple[int, ...]


_ARRAYS = ("goals", "targets", "covariance")
_SEVERAL = ("freed", "tried", "dropped", "left_out")
"""Where one stands for a tuple of one."""


def observation_message(observation: Observation) -> CorrectorMessage:
    """All that a corrector may use."""
    assembly = observation.assembly
    stated = {
        "solids": assembly.solids,
        "operations": assembly.operations,
        "fixed": sorted(assembly.fixed),
        "gaps": list(assembly.gaps.items()),
        "parts": list(observation.start),
        "gap_m": float(observation.gap_m),
        "play_m": float(observation.play_m),
        "outliers": observation.outliers,
        "shared": observation.shared,
        "tails": observation.tails,
    }
    start = np.array(list(observation.start.values())).reshape(-1, 4, 4)
    return msgspec.to_builtins(stated, enc_hook=_plain), {
        "start": start,
        "goals": observation.goals,
        "covariance": observation.covariance,
        "seen": observation.seen,
    }


def parse_observation(form: MessageForm, arrays: Arrays) -> Observation:
    """The observation of such a message."""
    assembly = Assembly(
        solids={part: _solid(**solid) for part, solid in form["solids"].items()},
        operations=msgspec.convert(form["operations"], tuple[Operation, ...]),
        fixed=frozenset(form["fixed"]),
        gaps=dict(msgspec.convert(form["gaps"], list[tuple[Contact, Gap]])),
    )
    return Observation(
        assembly,
        dict(zip(form["parts"], arrays["start"], strict=True)),
        goals=arrays["goals"],
        covariance=arrays["covariance"],
        seen=arrays["seen"],
        gap_m=form["gap_m"],
        play_m=form["play_m"],
        outliers=msgspec.convert(form["outliers"], OutlierModel | None),
        shared=tuple(SharedError(**one) for one in form["shared"]),
        tails=None if form["tails"] is None else Tails(**form["tails"]),
    )


def correction_message(correction: Correction) -> CorrectorMessage:
    """What a corrector returned.

    Raises:
        TypeError, ValueError: It holds what is no number, or no text, where one is needed.
    """
    stated = {name: getattr(correction, name) for name in _CorrectionForm.__struct_fields__}
    for name in _SEVERAL:
        many = isinstance(stated[name], Sequence) and not isinstance(stated[name], str | Try)
        stated[name] = stated[name] if many else (stated[name],)
    form = msgspec.to_builtins(stated, enc_hook=_plain)
    try:
        msgspec.convert(form, _CorrectionForm)
    except msgspec.ValidationError as error:
        raise ValueError(str(error)) from error
    possible = {name: getattr(correction, name) for name in _ARRAYS}
    return form, {name: array for name, array in possible.items() if array is not None}


def parse_correction(form: MessageForm, arrays: Arrays) -> Correction:
    """The correction of such a message.

    Raises:
        GarbledMessage: It is none, or a number is not finite where one must be.
    """
    try:
        fields = msgspec.structs.asdict(msgspec.convert(form, _CorrectionForm))
        schedule = tuple(Step(*step) for step in fields.pop("schedule"))
        possible: dict[str, Any] = {name: arrays.get(name) for name in _ARRAYS}
        return Correction(**fields, schedule=schedule, **possible)
    except (msgspec.ValidationError, ValueError, TypeError) as error:
        raise GarbledMessage("the message is no correction") from error


def _plain(value: Any) -> Any:
    """What is sent of a type that JSON does not know."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _solid(faces: MessageForm, pieces: list[MessageForm], rounds: MessageForm, **rest: Any) -> Solid:
    return Solid(
        faces={key: Face(**face) for key, face in faces.items()},
        pieces=tuple(_piece(**piece) for piece in pieces),
        rounds={
            key: RoundFace(**{**face, "span": tuple(face["span"]), "radii": tuple(face["radii"])})
            for key, face in rounds.items()
        },
        **rest,
    )


def _piece(**form: Any) -> Piece:
    if "half" in form:
        return Box(**form)
    if form["cylinder"] is not None:
        center, axis, *lengths = form["cylinder"]
        form["cylinder"] = Cylinder(np.array(center), np.array(axis), *lengths)
    return Hull(**form)
