"""The axes of contacts of round faces, to be drawn as dash-dot lines."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses
from apo_bench.geometry import Array, RoundFace, pose

_BEYOND_M = 0.02
"""How far a line goes on beyond the faces."""
_ONE_M = 1e-3
_ONE_COSINE = 1.0 - 1e-4
"""Axes that are nearer to each other are drawn as one line."""
_INK = (0.15, 0.15, 0.15)


class AxisEnds(NamedTuple):
    """A piece of an axis, (3,) each, world, [m]."""

    begin: Array
    end: Array


def holds_axis(assembly: Assembly, contact: Contact) -> bool:
    """Whether both faces of a contact are round, so that one axis lies on the other."""
    return all(of.face in assembly.solids[of.part].rounds for of in contact)


def axes_of(assembly: Assembly, contacts: Iterable[Contact], poses: Poses) -> list[AxisEnds]:
    """The axes of round faces that make contacts, each once, as long as its faces and a little longer."""
    lines: list[list[Array]] = []
    for contact in contacts:
        for of in contact:
            face = assembly.face_of(of)
            T = poses[of.part]
            if isinstance(face, RoundFace):
                _add(lines, pose.apply(T, face.ends), T[:3, :3] @ face.axis)
    return [_whole(points) for points in lines]


def axis_marks(assembly: Assembly, contacts: Iterable[Contact], poses: Poses) -> list[Any]:
    """The same as marks in a picture."""
    from apo_bench.simulation.scene.marks import AxisLine

    return [AxisLine(begin, end, _INK) for begin, end in axes_of(assembly, contacts, poses)]


def _add(lines: list[list[Array]], ends: Array, axis: Array) -> None:
    """Put the ends of a face, (2, 3), to those about the same axis."""
    for points in lines:
        # what of the two ends, seen from the first point, is not along the line: their distance from it
        line = _direction(points, axis)
        off = ends - points[0]
        across = np.linalg.norm(off - np.outer(off @ line, line), axis=1)
        if abs(line @ axis) > _ONE_COSINE and across.max() < _ONE_M:
            points.extend(ends)
            return
    lines.append(list(ends))


def _direction(points: list[Array], axis: Array) -> Array:
    """Along points of one line, (3,); the axis if they are one point, as of a rim."""
    way = points[1] - points[0]
    size = float(np.linalg.norm(way))
    return way / size if size > _ONE_M else axis


def _whole(points: list[Array]) -> AxisEnds:
    line = max(points, key=lambda p: float(np.linalg.norm(p - points[0]))) - points[0]
    line = line / max(float(np.linalg.norm(line)), 1e-12)
    # where each point lies along the line: from the first to the last one, and a little beyond both
    at = [float((p - points[0]) @ line) for p in points]
    return AxisEnds(points[0] + (min(at) - _BEYOND_M) * line, points[0] + (max(at) + _BEYOND_M) * line)
