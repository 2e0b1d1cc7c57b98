"""The solver of `manifold`, compiled: the same goals in a fraction of the time, one observation or many.

Needs the extra `fast`. Numba (Lam, Pitrou and Seibert, 2015) compiles `loops` when it is first asked for, which takes
10 to 20 seconds, and keeps the result beside it or in the user's cache folder.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.solvers import loops, loops_around, manifold
from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.manifold import NearestGoals, SolverTurn
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.twist import SERIES

_SAFE = ("reassoc", "contract", "nsz")
"""Liberties that the compiler may take: sums in another order, but numbers that are not finite stay what they are."""
HELPERS = (
    loops.worse,
    loops.ordered,
    loops.both,
    loops.linearise,
    loops.added,
    loops.gram,
    loops.towards,
    loops.factored,
    loops.substituted,
    loops.back,
    loops.step_share,
    loops.displaced,
    loops.cross_matrix,
    loops.scattered,
    loops_around.product,
    loops_around.dropped,
    loops_around.largest,
    loops_around.between,
    loops_around.rooted,
    loops_around.spanned,
    loops_around.spread,
)
KERNELS = (loops.solve_each, loops_around.prepared, loops_around.rated)
_RULE = (
    manifold.MOST_TURNS,
    manifold.STEP,
    manifold.SURE,
    manifold.NEXT,
    manifold.DAMPING,
    manifold.FALL,
    manifold.SQUARED_GAP_FLOOR,
    manifold.LARGEST_TURN,
    manifold.SMALLEST,
)
_FIELDS = ("goals", "z", "e", "Jt", "B", "at_rest", "finite")
_NONE, _SERIES = np.zeros(0), np.array(SERIES)


def nearest_goals_compiled(
    system: CompactEquations, goals: Array, L: Array, soft_m: Array | None = None
) -> NearestGoals:
    """Compiled `manifold.nearest_goals`: equal results but for rounding.

    One observation of very many operations is left to sparse matrices there, and one with shared errors as it is.

    Raises:
        InputError: Numba is not installed.
    """
    lead, n = goals.shape[:-3], system.n
    kernels = compiled_loops()
    if L.shape[-1] != 6 or (not lead and 6 * n > manifold.LARGEST_DENSE):
        return manifold.nearest_goals(system, goals, L, soft_m)
    b = math.prod(lead)
    many, turns = solved(
        kernels,
        system,
        _own(goals).reshape(b, n, 4, 4),
        _own(L[None] if L.ndim == 3 else np.broadcast_to(L, (*lead, n, 6, 6)).reshape(b, n, 6, 6)),
        soft_m,
    )
    longest = int(turns.ended.max(initial=0))
    worst = turns.trace[:, :longest].max(axis=0, initial=0.0)
    shaped = {name: getattr(many, name).reshape(lead + getattr(many, name).shape[1:]) for name in _FIELDS}
    return NearestGoals(**shaped, trace=tuple(SolverTurn(gap, step) for gap, step in worst.tolist()))


class Turns(NamedTuple):
    """The turns of every observation."""

    trace: Array
    """(b, MOST_TURNS, 2): the largest |e| before each turn, [m], and the length of its step; zeros behind the last."""
    ended: NDArray[np.intp]
    """(b,): how many there were."""


def solved(
    kernels: Kernels, system: CompactEquations, goals: Array, L: Array, soft_m: Array | None
) -> tuple[NearestGoals, Turns]:
    """The nearest goals of many observations, without a common trace, and the turns of each."""
    b, n, m = len(goals), system.n, 3 * len(system)
    T, z, e = np.empty((b, n, 4, 4)), np.empty((b, 6 * n)), np.empty((b, m))
    Jt, B = np.empty((b, 6 * n, m)), np.empty((b, n, 6, 6))
    rest, finite = np.empty(b, np.bool_), np.empty(b, np.bool_)
    turns = Turns(np.zeros((b, manifold.MOST_TURNS, 2)), np.empty(b, np.intp))
    kernels.solve_each(
        _own(system.start),
        (_own(system.letters, np.intp), _own(system.columns, np.intp), _own(system.inverse, np.intp)),
        _own(system.plane),
        _own(system.points if system.points.ndim > 3 else system.points[None]),
        goals,
        L,
        _NONE if soft_m is None else _own(soft_m),
        _SERIES,
        _RULE,
        (T, z, e, Jt, B),
        rest,
        finite,
        *turns,
    )
    return NearestGoals(T, z, e, Jt, B, rest, finite, ()), turns


class Kernels(NamedTuple):
    """The loops, compiled."""

    solve_each: Callable[..., None]
    prepared: Callable[..., None]
    rated: Callable[..., None]


@cache
def kept_loops() -> Kernels | None:
    """The loops, compiled; None where Numba is not installed, or would have to compile anew in every process."""
    try:
        return _compiled(kept=True)
    except (InputError, RuntimeError):
        return None


@cache
def compiled_loops() -> Kernels:
    """The loops, compiled; in every process anew where there is no folder to keep them in.

    Raises:
        InputError: Numba is not installed.
    """
    try:
        return _compiled(kept=True)
    except RuntimeError:
        return _compiled(kept=False)


def _compiled(kept: bool) -> Kernels:
    try:
        from numba import config, njit
        from numba.extending import register_jitable
    except ImportError as error:
        raise InputError(
            f"the compiled solver needs Numba, which cannot be imported ({error}); "
            "pip install 'apo_bench[fast]', or use the corrector 'contact'."
        ) from error
    vars(config)["CACHE_DIR"] = os.environ.get("NUMBA_CACHE_DIR", "")  # not what a file in the current folder says
    for function in HELPERS:
        register_jitable(fastmath=set(_SAFE))(function)
    compiler: Any = njit(fastmath=set(_SAFE), error_model="numpy", cache=kept)
    return Kernels(*map(compiler, KERNELS))


def _own(x: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """An array made contiguous and writable: the compiled code knows one kind of array."""
    known = x.flags
    if x.dtype == dtype and known.c_contiguous and known.writeable:
        return np.asarray(x)
    return np.array(x, dtype=dtype, order="C")
