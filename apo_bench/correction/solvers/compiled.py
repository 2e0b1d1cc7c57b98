"""The solver of `manifold`, compiled: the same goals in a fraction of the time, one observation or many.

Needs the extra `fast`. Numba (Lam, Pitrou and Seibert, 2015) compiles `loops` when it is first asked for, which takes
10 to 20 seconds, and keeps the result beside it or in the user's cache folder.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.equations import Equations
from apo_bench.correction.solvers import loops, manifold
from apo_bench.correction.solvers.compact import ROUNDING, SMALLEST, CompactEquations
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
)
_RULE = (
    manifold.MOST_TURNS,
    manifold.STEP,
    manifold.SURE,
    manifold.DAMPING,
    manifold.FALL,
    manifold.SQUARED_GAP_FLOOR,
    manifold.LARGEST_TURN,
    manifold.SMALLEST,
)


def nearest_goals_compiled(
    system: CompactEquations, goals: Array, L: Array, soft_m: Array | None = None
) -> NearestGoals:
    """Compiled `manifold.nearest_goals`: equal results but for rounding.

    One observation of very many operations is left to sparse matrices there.

    Raises:
        InputError: Numba is not installed.
    """
    (solve, _), lead, n, m = _compiled(), goals.shape[:-3], system.n, 3 * len(system)
    if not lead and 6 * n > manifold.LARGEST_DENSE:
        return manifold.nearest_goals(system, goals, L, soft_m)
    b = math.prod(lead)
    out = tuple(np.empty((b, *shape)) for shape in ((n, 4, 4), (6 * n,), (m,), (6 * n, m), (n, 6, 6)))
    rest, finite, trace = np.empty(b, np.bool_), np.empty(b, np.bool_), np.zeros((manifold.MOST_TURNS, 2))
    turns = solve(
        _own(system.start),
        (_own(system.letters, np.intp), _own(system.columns, np.intp), _own(system.inverse, np.intp)),
        _own(system.plane),
        _own(system.points if system.points.ndim > 3 else system.points[None]),
        _own(goals).reshape(b, n, 4, 4),
        _own(L[None] if L.ndim == 3 else np.broadcast_to(L, (*lead, n, 6, 6)).reshape(b, n, 6, 6)),
        np.zeros(0) if soft_m is None else _own(soft_m),
        _own(SERIES),
        _RULE,
        out,
        rest,
        finite,
        trace,
    )
    T, z, e, Jt, B, at_rest, ended = (x.reshape(lead + x.shape[1:]) for x in (*out, rest, finite))
    return NearestGoals(
        T, z, e, Jt, B, at_rest, ended, tuple(SolverTurn(gap, step) for gap, step in trace[:turns].tolist())
    )


def compact_equations_compiled(system: Equations, n: int) -> CompactEquations:
    """Compiled `compact.compact_equations`.

    Raises:
        InputError: Numba is not installed.
    """
    _, summarised = _compiled()
    (c, w), p = system.letters.shape, len(system.start)
    columns, plane, points = np.empty((c, w), np.intp), np.zeros((c, 4)), np.zeros((c, 3, 4))
    summarised(
        _own(system.contact, np.intp),
        _own(system.vertex),
        _own(system.plane),
        _own(system.letters, np.intp),
        p,
        n,
        ROUNDING,
        SMALLEST,
        columns,
        plane,
        points,
    )
    return CompactEquations(system.start, system.letters, columns, system.inverse, plane, points, n)


@cache
def _compiled() -> tuple[Callable[..., int], Callable[..., None]]:
    """`solve` and `summarised` of `loops`."""
    try:
        from numba import njit
        from numba.extending import register_jitable
    except ImportError as error:
        raise InputError(
            f"the compiled solver needs Numba, which cannot be imported ({error}); "
            "pip install 'apo_bench[fast]', or use the corrector 'contact'."
        ) from error
    for function in HELPERS:
        register_jitable(fastmath=set(_SAFE))(function)

    def compiled(function: Any) -> Any:
        try:
            return njit(cache=True, fastmath=set(_SAFE), error_model="numpy")(function)
        except RuntimeError:  # nowhere to keep it: it is compiled anew in every process
            return njit(fastmath=set(_SAFE), error_model="numpy")(function)

    return compiled(loops.solve_each), compiled(loops.summarised)


def _own(x: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """An array made contiguous and writable: the compiled code knows one kind of array."""
    known = x.flags
    if x.dtype == dtype and known.c_contiguous and known.writeable:
        return np.asarray(x)
    return np.array(x, dtype=dtype, order="C")
