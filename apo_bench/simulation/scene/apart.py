"""Pieces that are surely apart, told to MuJoCo before it measures them: states are the same, and come sooner.

MuJoCo asks a function, if it is given one (`mjcb_contactfilter`), of each pair of geoms whose boxes meet. Numba
compiles this one where it is installed; elsewhere none is given. It does what MuJoCo does without one, and leaves out a
pair of which one lies behind a plane that a cylinder around the other does not reach. No contact is lost by that.

The function is given addresses. Where in MuJoCo's two structures the arrays that it needs are is found by looking for
their addresses there, so it depends on no version.
"""

import ctypes
import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from itertools import count
from threading import Lock
from typing import Any

import mujoco
import numpy as np

from apo_bench.geometry import Ints
from apo_bench.simulation.scene.world import World

SURELY_M = 1e-7
"""Pairs that are farther apart are left out: much more than what MuJoCo or this may be wrong by."""
_MOST = 8
"""So many models at a time; of others no pair is left out."""
_MODEL_BYTES = 4_000
_DATA_BYTES = 162_000
"""Addresses are looked for in so much of the structures, both of which are larger in MuJoCo 3.17 and 4.0."""
_ONE_AT_A_TIME = Lock()


@contextmanager
def left_out(world: World) -> Iterator[None]:
    """Pairs of pieces that are surely apart are not measured for a while; not where a filter of others is at work."""
    asked = _asked() if len(world.bounds) else None
    at = None if asked is None else _enter(world, asked)
    try:
        yield
    finally:
        if at is not None:
            _leave(at, asked)


def _enter(world: World, asked: Any) -> int | None:
    """Have pairs of a model left out; returns its row among the models, None if it gets none."""
    with _ONE_AT_A_TIME:
        models = _models()
        free = np.flatnonzero(models[:, 0] == 0)
        if mujoco.get_mjcb_contactfilter() not in (None, asked.ctypes) or len(free) == 0:
            return None
        # The address of the model comes last: by it the row is found, also by steps that are under way.
        models[free[0], 1] = world.bounds.ctypes.data
        models[free[0], 0] = world.model._address
        mujoco.set_mjcb_contactfilter(asked.ctypes)
        return int(free[0])


def _leave(at: int, asked: Any) -> None:
    with _ONE_AT_A_TIME:
        models = _models()
        models[at, 0] = 0
        if not models[:, 0].any() and mujoco.get_mjcb_contactfilter() is asked.ctypes:
            mujoco.set_mjcb_contactfilter(None)


@cache
def _models() -> Ints:
    """Addresses of models of which pairs are left out, 0 if none, and of their bounds, (most, 2)."""
    return np.zeros((_MOST, 2), dtype=np.int64)


@cache
def _asked() -> Any:
    """The compiled function; None without Numba, or where MuJoCo keeps its arrays otherwise."""
    try:
        from numba import cfunc, njit, types
        from numba.extending import intrinsic
    except ImportError:
        return None
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    data = mujoco.MjData(model)
    contypes = _offset(model, model.geom_contype, _MODEL_BYTES)
    conaffinities = _offset(model, model.geom_conaffinity, _MODEL_BYTES)
    places = _offset(data, data.geom_xpos, _DATA_BYTES)
    turns = _offset(data, data.geom_xmat, _DATA_BYTES)
    if contypes is None or conaffinities is None or places is None or turns is None:
        return None
    known = int(_models().ctypes.data)

    def read(kind: Any) -> Any:
        """A function that reads one number at an address."""

        def typed(context: Any, address: Any) -> Any:
            def written(context: Any, builder: Any, signature: Any, given: Any) -> Any:
                return builder.load(builder.inttoptr(given[0], context.get_value_type(kind).as_pointer()))

            return kind(address), written

        return intrinsic(typed)

    whole = read(types.int64)
    short = read(types.int32)
    real = read(types.float64)

    @njit(error_model="numpy")
    def reaches(wall: int, x: int, R: int, shaft: int, y: int, Q: int) -> bool:
        nx = real(wall)
        ny = real(wall + 8)
        nz = real(wall + 16)
        radius = real(shaft + 80)
        if radius < 0.0 or nx == ny == nz == 0.0:
            return True
        # Of a cylinder (c, a, r, h) the farthest point along n has n . x = n . c + r sqrt(1 - (n . a)^2) + h |n . a|.
        far = SURELY_M - real(wall + 24)
        along = 0.0
        for i in range(0, 24, 8):
            w = R + 3 * i
            s = Q + 3 * i
            n = real(w) * nx + real(w + 8) * ny + real(w + 16) * nz
            c = real(s) * real(shaft + 32) + real(s + 8) * real(shaft + 40) + real(s + 16) * real(shaft + 48)
            a = real(s) * real(shaft + 56) + real(s + 8) * real(shaft + 64) + real(s + 16) * real(shaft + 72)
            far += n * (c + real(y + i) - real(x + i))
            along += n * a
        far += radius * math.sqrt(max(0.0, 1.0 - along * along)) + real(shaft + 88) * abs(along)
        return not far < 0.0  # what is not a number is left to MuJoCo

    @cfunc(types.int32(types.int64, types.int64, types.int32, types.int32), error_model="numpy")
    def asked(model: int, data: int, a: int, b: int) -> int:
        contype = whole(model + contypes)
        conaffinity = whole(model + conaffinities)
        if not (
            short(contype + 4 * a) & short(conaffinity + 4 * b) or short(contype + 4 * b) & short(conaffinity + 4 * a)
        ):
            return 1
        for i in range(known, known + 16 * _MOST, 16):
            if whole(i) == model:
                bounds = whole(i + 8)
                p = bounds + 96 * a
                q = bounds + 96 * b
                x = whole(data + places)
                R = whole(data + turns)
                forth = reaches(p, x + 24 * a, R + 72 * a, q, x + 24 * b, R + 72 * b)
                return 0 if forth and reaches(q, x + 24 * b, R + 72 * b, p, x + 24 * a, R + 72 * a) else 1
        return 0

    return asked


def _offset(structure: Any, array: Any, most: int) -> int | None:
    """Where in one of MuJoCo's structures the address of an array is, in bytes; None if it is not found there.

    Arrays without elements stand before it at the same address.
    """

    def there(at: int) -> bool:
        return bool(ctypes.c_int64.from_address(structure._address + at).value == array.ctypes.data)

    at = next((at for at in range(0, most, 8) if there(at)), None)
    return None if at is None else next(at for at in count(at, 8) if not there(at + 8))
