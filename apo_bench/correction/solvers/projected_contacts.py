"""Contact equations of one assembly at given poses, with vertices projected onto the faces that they touch."""

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, EquationPattern, find_equation_pattern
from apo_bench.correction.solvers.compact import CompactEquations, moments
from apo_bench.correction.solvers.word_products import Words, words_of
from apo_bench.geometry import Array, pose, remember

_ONE = np.eye(4)
"""The identity pose."""


@final
@dataclass(frozen=True, eq=False)
class ProjectedContacts:
    """The equations of all contacts, with vertices projected at some poses."""

    system: CompactEquations
    """With points (*, c, 3, 4)."""
    vertex: Array
    """(*, m, 4), frame of the environment part, [m]."""
    forms: Array
    """(*, c, 4): as of `CompactEquations.forms`, at these poses."""
    pattern: EquationPattern

    def only(self, some: slice) -> "ProjectedContacts":
        """The equations of some of the observations."""
        return ProjectedContacts(self.system.only(some), self.vertex[some], self.forms[some], self.pattern)

    def gaps(self, forms: Array) -> Array:
        """The largest |e| of each contact, (*, c), [m], from n D_a^-1 D_b of each contact, (*, c, 4)."""
        if not len(self.pattern.contact):
            return np.zeros(forms.shape[:-1])
        e = (forms.take(self.pattern.contact, axis=-2) * self.vertex).sum(axis=-1)
        return np.asarray(np.maximum.reduceat(np.abs(e), self.pattern.begin[:-1], axis=-1))

    def faces_away(self, forms: Array) -> NDArray[np.bool_]:
        """Which contacts have faces that do not oppose, (*, c), as in `find_faces_away`."""
        return np.asarray((forms[..., :3] * self.pattern.onto[:, :3]).sum(axis=-1) > self.pattern.opposing)


def project_vertices(assembly: Assembly, start: Array, plane: Array, poses: Array) -> ProjectedContacts:
    """The equations of all contacts of an assembly, with vertices projected at the poses, (*, n, 4, 4).

    Vertices of the environment face stay where they are. Vertices of the manipulated face are transformed by the
    inverse of the word of their contact and projected onto the plane of the environment face. That is one affine map
    per contact, which is applied to the three points that stand for the vertices, too.

    Args:
        start: (p, 4, 4), start poses.
        plane: (c, 4), shifted to the distance at which equations must hold.
    """
    corners = _corners(assembly)
    constants = corners.words.constants(start)
    products = corners.words.products(constants, poses)
    maps = np.where(corners.laid, corners.drops @ pose.inverse(products), _ONE)
    vertex = (maps.take(corners.pattern.contact, axis=-3) @ corners.vertex)[..., 0]
    points = corners.points @ np.swapaxes(maps, -1, -2)
    forms = (plane[:, None] @ products)[..., 0, :]
    return ProjectedContacts(CompactEquations(corners.words, constants, plane, points), vertex, forms, corners.pattern)


class _Corners(NamedTuple):
    """The pose-independent part of the projected contacts of an assembly."""

    pattern: EquationPattern
    words: Words
    laid: NDArray[np.bool_]
    """(c, 1, 1): whether the vertices are those of the manipulated face."""
    vertex: Array
    """(m, 4, 1), in the frame of their own part, [m]."""
    points: Array
    """(c, 3, 4): the points that stand for the vertices (`compact.moments`), in the frame of their own part."""
    drops: Array
    """(c, 4, 4): the projections v -> v - n (n v) onto the plane of the environment face."""


@remember
def _corners(assembly: Assembly) -> _Corners:
    """Compute the pose-independent part of an assembly's contacts."""
    known = find_equation_pattern(assembly)
    normal = np.array(known.onto)
    normal[:, 3] = 0.0
    return _Corners(
        known,
        words_of(known.letters, known.inverse, len(assembly.solids), len(assembly)),
        known.laid[:, None, None],
        known.corners[..., None],
        moments(known.corners[:, :3], known.contact, len(known.letters)),
        np.asarray(_ONE - normal[:, :, None] * known.onto[:, None, :]),
    )
