"""Is a relation wrong? The chi-square test of a correction, and which relation to suspect if it fails.

If every relation is right and the stated noise is too, the squared length of the correction is chi-square distributed
with as many degrees of freedom as the contacts fix. A redundant contact that is wrong contradicts the others; one that
is not redundant only asks for a correction that is too long. In both cases everything fits once it is left out, so the
relations are ranked by how well the rest fits without them. More than one may do: they form the ambiguity set, and
nothing that was seen tells them apart.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly
from apo_bench.correction.compact import Compact
from apo_bench.correction.manifold import Nearest, nearest
from apo_bench.correction.posterior import rank
from apo_bench.geometry.arrays import Array
from apo_bench.program import Consistency, Suspect

LEVEL = 0.01
"""False alarms that are accepted."""
MOST = 64
"""Relations that are left out in turn; of more, those that pull hardest."""
SOFT_M = 0.05e-3
"""Standard deviation that contradictory contacts are given, [m], so that their contradiction can be measured."""


def consistency(
    system: Compact, seen: Array, L: Array, found: Nearest, slack_m: Array, level: float = LEVEL
) -> Consistency:
    """Test a solution, without looking for suspects.

    Args:
        seen: (n, 4, 4), the goals that were seen.
        L: (n, 6, 6), their covariance is L L^t.
        slack_m: (3 c,), standard deviation of each equation that the play of parts that fit leaves, [m].
    """
    chi_square, freedom = _measured(system, seen, L, found, slack_m)
    return Consistency(chi_square, freedom, p_value(chi_square, freedom), level)


def suspects(
    assembly: Assembly, system: Compact, seen: Array, L: Array, slack_m: Array, among: NDArray[np.bool_]
) -> tuple[Suspect, ...]:
    """Every relation whose contacts are `among`, (c,), those considered, left out in turn; the most suspect first.

    Of more than `MOST`, only the likeliest are tried.
    """
    relations, ranked = assembly.relations(), list[tuple[tuple[float, float], Suspect]]()
    every = assembly.arcs()
    considered = [i for i, arc in enumerate(every) if among[list(arc)].any()]
    for i in _likely(assembly, considered, system, seen, L, slack_m, among):
        kept = among.copy()
        kept[list(every[i])] = False
        slack = slack_m[np.repeat(kept, 3)]
        part = system.among(kept)
        chi_square, freedom = _measured(part, seen, L, nearest(part, seen, L), slack)
        p = p_value(chi_square, freedom)
        contacts = tuple(relations[j].contact for j in every[i])
        suspect = Suspect(f"R{i + 1}", contacts, relations[every[i][0]].made, chi_square, freedom, p)
        ranked.append(((-p, (chi_square - freedom) / sqrt(2 * freedom + 1)), suspect))
    return tuple(suspect for _, suspect in sorted(ranked, key=lambda one: one[0]))


def _likely(
    assembly: Assembly,
    considered: list[int],
    system: Compact,
    seen: Array,
    L: Array,
    slack_m: Array,
    among: NDArray[np.bool_],
) -> list[int]:
    """At most `MOST` of the arcs: those that pull hardest, by the weighted multipliers of their equations."""
    if len(considered) <= MOST:
        return considered
    soft = np.hypot(slack_m, SOFT_M)[np.repeat(among, 3)]
    pull = np.zeros((len(system), 3))
    pull[among] = (nearest(system.among(among), seen, L, soft).e / soft).reshape(-1, 3)
    size = (pull * pull).sum(axis=1)
    arcs = assembly.arcs()
    return sorted(sorted(considered, key=lambda i: -size[list(arcs[i])].sum())[:MOST])


def slack(fits: NDArray[np.bool_], system: Compact, play_m: float) -> Array:
    """The standard deviation of each compact equation, (3 c,), [m]: a contact that fits is uniform within its play.

    A row stands for all vertices of its contact, so it is off by as much as they are together.
    """
    count = system.points[..., 0, 3] ** 2
    each = np.where(fits, play_m / sqrt(3.0), 0.0) * np.sqrt(count)
    return np.repeat(each, 3)


def p_value(chi_square: float, freedom: int) -> float:
    """The chance of a chi-square at least as large; 1 where nothing is tested."""
    from scipy.special import chdtrc

    if not np.isfinite(chi_square):
        return 0.0
    return float(chdtrc(freedom, chi_square)) if freedom else 1.0


def _measured(system: Compact, seen: Array, L: Array, found: Nearest, slack_m: Array) -> tuple[float, int]:
    """The squared length and its degrees of freedom; of contradictory contacts, with what is left of them."""
    freedom = rank(found.Jt)
    if not found.finite:
        return np.inf, freedom
    holds = found.at_rest and np.abs(found.e).max(initial=0.0) <= SOFT_M
    if holds and not slack_m.any():
        return float(found.z @ found.z), freedom
    soft = slack_m if holds else np.hypot(slack_m, SOFT_M)
    relaxed = nearest(system, seen, L, soft)
    asked = soft > 0.0
    over = relaxed.e[asked] / soft[asked]
    return float(relaxed.z @ relaxed.z + over @ over), freedom
