"""The solids of `made`, built by build123d and written as STEP."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.importers.cad import made
from tests.importers.cad.made import MADE, Made


class Brep:
    """What `made` uses of manifold3d, with exact faces."""

    def __init__(self, shape: Any) -> None:
        self.shape = shape

    @staticmethod
    def cube(size: tuple[float, float, float], center: bool) -> Brep:
        from build123d import Box

        assert center
        return Brep(Box(*size))

    @staticmethod
    def cylinder(height: float, low: float, high: float, n: int) -> Brep:
        from build123d import Align, Cone, Cylinder, RegularPolygon, extrude

        align = (Align.CENTER, Align.CENTER, Align.MIN)
        if n < 12:
            return Brep(extrude(RegularPolygon(low, n, rotation=0), height))
        return Brep(Cylinder(low, height, align=align) if low == high else Cone(low, high, height, align=align))

    @staticmethod
    def extrude(outline: list[tuple[float, float]], height: float) -> Brep:
        from build123d import Polygon, extrude

        return Brep(extrude(Polygon(*outline, align=None), height))

    def translate(self, at: tuple[float, float, float]) -> Brep:
        from build123d import Pos

        return Brep(Pos(*at) * self.shape)

    def rotate(self, deg: tuple[float, float, float]) -> Brep:
        from build123d import Axis, Solid

        shape = self.shape
        for axis, angle in zip((Axis.X, Axis.Y, Axis.Z), deg, strict=True):
            shape = shape.rotate(axis, angle)
        return Brep(Solid(_with_turned_faces(shape.solid().wrapped)))

    def __add__(self, other: Brep) -> Brep:
        return Brep(self.shape + other.shape)

    def __sub__(self, other: Brep) -> Brep:
        return Brep(self.shape - other.shape)


def _with_turned_faces(shape: Any) -> Any:
    """The same at the same place, with the place in its faces instead of before it."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.TopLoc import TopLoc_Location

    turn = shape.Location().Transformation()
    return BRepBuilderAPI_Transform(shape.Located(TopLoc_Location()), turn, True).Shape()


def rounded_plate() -> Made:
    """With true arcs; those of `made` are polygons."""
    from build123d import Axis, Box, Pos, fillet

    plate = Pos(0, 0, 5) * Box(60, 40, 10)
    return MADE["rounded_plate"]()._replace(mesh=Brep(fillet(plate.edges().filter_by(Axis.Z), 6)))


def brep_made(name: str) -> Made:
    """A solid of `MADE` whose `mesh` has exact faces."""
    own: dict[str, Callable[[], Made]] = {"rounded_plate": rounded_plate}
    if name in own:
        return own[name]()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(made, "Manifold", Brep)
        patch.setattr(made, "CrossSection", lambda outlines: outlines[0])
        return MADE[name]()


def write_step(shape: Any, path: Path) -> Path:
    """A STEP file in mm."""
    from build123d import export_step

    assert export_step(shape.shape if isinstance(shape, Brep) else shape, path)
    return path
