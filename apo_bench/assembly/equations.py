"""The face contact equations of an assembly and their Jacobian, of the paper that `apo_bench.correction` names.

A contact says that vertices v of a face of the environment part b lie on the plane n of a face of the manipulated
part a:  e = n D_a^-1 D_b v = 0, with n = (n_x, n_y, n_z, -d) in the frame of a and v = (x, y, z, 1) in that of b.
Both D are the ODLs right after the operation that made the contact; contacts that were lost later stay in.

That is Eq. 26 (and 25), e = n D_a^-1 D_b v. Eq. 1, e = n T_a^-1 T_b v, is the same of parts that were moved alone,
where v needs its 1, which is not printed; Eq. 3 puts T dT for T, e = n dT_a^-1 T_a^-1 T_b dT_b v, where T_b^-1 is
printed for T_a^-1. In R8 and R9 of Section 3.3.2 the last T_6 should be T_6^-1.

A part that was never moved rests where it started. That pose is one more motion parameter, known and never free:
the operations are preceded by one operation per part that puts it at its start.
"""

from collections.abc import Collection
from dataclasses import dataclass
from itertools import accumulate
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.equation_pattern import cross_rows, find_equation_pattern
from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, evaluate_odl
from apo_bench.geometry import Array, pose


@final
@dataclass(frozen=True, eq=False)
class Equations:
    """m scalar equations in the motion parameters of n operations; the vertices stay as they are during a solve."""

    start: Array
    """(p, 4, 4): the constant motion parameters, the start poses of p parts."""
    letters: NDArray[np.intp]
    """(c, w): the word D_a^-1 D_b of each contact as indices: p start poses, then n poses, then the identity as
    padding."""
    inverse: NDArray[np.bool_]
    """(c, w): which letters of the words are inverted."""
    made: NDArray[np.intp]
    """(c,): the operation that made each contact, counted from 0."""
    contact: NDArray[np.intp]
    """(m,): the contact of each equation."""
    plane: Array
    """(m, 4): n of Eq. 1, frame of the manipulated part."""
    vertex: Array
    """(m, 4): v of Eq. 1, frame of the environment part, [m]."""

    def __len__(self) -> int:
        return len(self.contact)

    def variables(self, n: int) -> tuple[int, ...]:
        """The operations, of `n`, whose motion parameters occur, the most recent first."""
        occurring = np.unique(self.letters) - len(self.start)
        return tuple(int(k) for k in occurring[::-1] if 0 <= k < n)

    def contacts_with(self, free: Collection[int]) -> NDArray[np.bool_]:
        """Whether the word of each contact contains a motion parameter of the `free` operations, (c,)."""
        wanted = np.array(sorted(free), dtype=np.intp) + len(self.start)
        return np.asarray(np.isin(self.letters, wanted).any(axis=1))

    def among(self, contacts: NDArray[np.bool_]) -> "Equations":
        """The equations of the chosen contacts, (c,), alone."""
        rows = contacts[self.contact]
        number = np.cumsum(contacts) - 1
        return Equations(
            start=self.start,
            letters=self.letters[contacts],
            inverse=self.inverse[contacts],
            made=self.made[contacts],
            contact=number[self.contact[rows]],
            plane=self.plane[rows],
            vertex=self.vertex[rows],
        )

    def gaps(self, poses: Array) -> Array:
        """The largest |e| of each contact, (c,), [m]; NaN where a number is not finite."""
        largest_of_each = np.zeros(len(self.letters))
        np.maximum.at(largest_of_each, self.contact, np.abs(self.residual(poses)))
        return largest_of_each

    def residual(self, poses: Array) -> Array:
        """e of every equation, (m,), [m]: positive where the faces are apart, negative where they penetrate."""
        return np.einsum("mi,mi->m", self.plane, self._points(self._matrices(poses))[0])

    def linearise(self, poses: Array) -> tuple[Array, Array]:
        """e, (m,), and its derivative by the body twists of all poses, (m, 6 n), [m] per [m, rad]: df/dq of Eq. 10.

        A letter T in n .. T .. v turns n (everything up to T) = (a, .) and (everything behind T) v = p, so its rows
        are +(a, p x a); T^-1 stays on the side of v, and its rows are -(a, p x a). A T that occurs twice adds up.
        """
        m = len(self)
        n = len(poses)
        w = self.letters.shape[1]
        F = self._matrices(poses)
        points = np.array(self._points(F))
        forms = np.array(self._forms(F))
        inverse = self.inverse[self.contact].T
        # T goes to the plane, so both are taken behind it, at j + 1; T^-1 goes to the vertex: both before it, at j.
        side = np.arange(w)[:, None] + ~inverse, np.arange(m)
        a = forms[side][..., :3].reshape(-1, 3)
        p = points[side][..., :3].reshape(-1, 3)
        rows = np.concatenate([a, cross_rows(p, a)], axis=1).reshape(w, m, 6) * np.where(inverse, -1.0, 1.0)[..., None]
        J = np.zeros((m, n + 1, 6))
        k = self.letters - len(self.start)
        # Constants, the starts and the padding, go to an extra column n, which is dropped at the end.
        columns = np.where((k >= 0) & (k < n), k, n)[self.contact]
        # One letter at a time, since += counts a repeated index once: an operation may occur twice in a word.
        for j in range(w):
            J[np.arange(m), columns[:, j]] += rows[j]
        return np.einsum("mi,mi->m", self.plane, points[0]), J[:, :n].reshape(m, 6 * n)

    def _matrices(self, poses: Array) -> Array:
        """F_1 .. F_w of the word of each equation, (m, w, 4, 4)."""
        F = np.concatenate([self.start, poses, np.eye(4)[None]])[self.letters]
        return np.where(self.inverse[..., None, None], pose.inverse(F), F)[self.contact]

    def _points(self, F: Array) -> list[Array]:
        """F_j+1 .. F_w v for every j, the vertices transformed by the last letters: w + 1 arrays (m, 4)."""
        letters = reversed(F.swapaxes(0, 1))
        return list(accumulate(letters, lambda v, T: np.einsum("mij,mj->mi", T, v), initial=self.vertex))[::-1]

    def _forms(self, F: Array) -> list[Array]:
        """n F_1 .. F_j for every j, the planes transformed by the first letters: w + 1 arrays (m, 4)."""
        letters = F.swapaxes(0, 1)
        return list(accumulate(letters, lambda n, T: np.einsum("mi,mij->mj", n, T), initial=self.plane))


def build_contact_equations(assembly: Assembly, start: Poses, poses: Array) -> Equations:
    """The equations of all contacts, present and lost, in the order of `assembly.relations()`.

    Contacts of round faces are replaced by those of sheets (`project_round_faces`).

    The vertices are the corners of the smaller face of a pair, projected onto the plane of the other one at `poses`.
    Only one face is used, since both would raise the spurious singular values. It is not clipped, since the clipped
    polygon changes with the noise, nor is the larger face used: a lever as long as a table turns a degree into
    centimetres.

    Args:
        poses: (n, 4, 4), where the vertices are taken, world frame, [m].
    """
    known = find_equation_pattern(assembly)
    constants = np.array([start[part] for part in assembly.solids]).reshape(-1, 4, 4)
    stack = np.concatenate([constants, poses])
    vertex = np.array(known.corners)
    for c in np.flatnonzero(known.laid):
        rows = slice(known.begin[c], known.begin[c + 1])
        # v = (D_a^-1 D_b)^-1 v_a takes corners of a to the frame of b; there v - (n v) n lays them onto the plane of b.
        corners = pose.apply(pose.inverse(evaluate_odl(known.words[c], stack)), vertex[rows, :3])
        n = known.onto[c]
        vertex[rows, :3] = corners - np.outer(corners @ n[:3] + n[3], n[:3])
    return Equations(
        constants, known.letters, known.inverse, known.made, known.contact, known.plane[known.contact], vertex
    )


def measure_largest_gap(assembly: Assembly, start: Poses, poses: Array) -> float:
    """The largest |e| of all contacts at `poses`, [m]; 0 if there are none."""
    return find_largest_residual(build_contact_equations(assembly, start, poses).residual(poses))


def find_largest_residual(e: Array) -> float:
    """The largest |e|; 0 if there are no equations."""
    return float(np.max(np.abs(e), initial=0.0))
