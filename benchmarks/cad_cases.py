"""Files at the limits of `part import`, made by scripts: wrong units, broken shells, sizes, no CAD at all."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from manifold3d import Manifold

Folder = Path
_FINE = 0.34
_TEXT = "This is a letter, not a part.\n" * 100


class Case(NamedTuple):
    """A file, and how it is imported."""

    make: Callable[[Folder], Path]
    options: tuple[str, ...] = ()


def block(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    return Manifold.cube((x, y, z), True).translate(at)


def bored(size: tuple[float, float, float], r: float, sides: int = 64) -> Any:
    return block(*size) - Manifold.cylinder(2 * size[2], r, r, sides, True)


def triangles(mesh: Any) -> Any:
    raw = mesh.to_mesh()
    return np.asarray(raw.vert_properties)[:, :3][np.asarray(raw.tri_verts)]


def stl(given: Any, scale: float = 1.0) -> Callable[[Folder], Path]:
    """A binary STL file of a solid, or of triangles (t, 3, 3)."""

    def make(folder: Folder) -> Path:
        each = triangles(given()) if isinstance(given(), Manifold) else given()
        row = np.zeros(len(each), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("x", "<u2")])
        row["c"] = each * scale
        path = folder / "part.stl"
        path.write_bytes(bytes(80) + len(each).to_bytes(4, "little") + row.tobytes())
        return path

    return make


def text(name: str, content: bytes | str) -> Callable[[Folder], Path]:
    def make(folder: Folder) -> Path:
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return make


def sparse(name: str, size: int) -> Callable[[Folder], Path]:
    """A file of zeros that takes no room on the disk."""

    def make(folder: Folder) -> Path:
        path = folder / name
        with path.open("wb") as file:
            file.truncate(size)
        return path

    return make


def pipe(name: str) -> Callable[[Folder], Path]:
    def make(folder: Folder) -> Path:
        os.mkfifo(folder / name)
        return folder / name

    return make


def folder_named(name: str) -> Callable[[Folder], Path]:
    def make(folder: Folder) -> Path:
        (folder / name).mkdir()
        return folder / name

    return make


def link(name: str, to: str) -> Callable[[Folder], Path]:
    def make(folder: Folder) -> Path:
        (folder / name).symlink_to(to)
        return folder / name

    return make


def opened() -> Any:
    return triangles(bored((40, 30, 10), 4))[:-1]


def inside_out() -> Any:
    return triangles(bored((40, 30, 10), 4))[:, ::-1]


def mixed() -> Any:
    given = triangles(bored((40, 30, 10), 4))
    given[::3] = given[::3, ::-1]
    return given


def crossed() -> Any:
    return np.concatenate([triangles(block(20, 20, 20)), triangles(block(10, 10, 40, (3, 2, 1)))])


def touching() -> Any:
    return np.concatenate([triangles(block(20, 20, 20)), triangles(block(20, 20, 20, (20, 0, 0)))])


def sheet() -> Any:
    """Two sides of one sheet: closed, without room inside."""
    one = np.array([[[0, 0, 0], [40, 0, 0], [40, 30, 0]], [[0, 0, 0], [40, 30, 0], [0, 30, 0]]], dtype=float)
    return np.concatenate([one, one[:, ::-1]])


def infinite() -> Any:
    given = triangles(block(40, 30, 10))
    given[0, 0, 0] = np.nan
    return given


def crumpled() -> Any:
    """Each corner at random in one small box: every triangle crosses most others."""
    rng = np.random.default_rng(18)
    given = triangles(Manifold.sphere(20, 200))
    corners, index = np.unique(given.reshape(-1, 3), axis=0, return_inverse=True)
    return rng.uniform(-20, 20, corners.shape)[index.ravel()].reshape(-1, 3, 3)


def sieve(many: int = 20) -> Any:
    """A plate with many holes."""
    at = 8.0 * (np.arange(many) - (many - 1) / 2)
    holes = [Manifold.cylinder(20, 2.5, 2.5, 32, True).translate((x, y, 0)) for x in at for y in at]
    return block(8 * many + 10, 8 * many + 10, 5) - Manifold.batch_boolean(holes, _add())


def _add() -> Any:
    from manifold3d import OpType

    return OpType.Add


def three_mf(vertices: int) -> Callable[[Folder], Path]:
    """One object with so many corners, and one tetrahedron of them."""

    def make(folder: Folder) -> Path:
        path = folder / "part.3mf"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("3D/m.model", "w") as file:
            file.write(b'<model unit="millimeter"><resources><object id="1" name="a"><mesh><vertices>')
            for x, y, z in ((0, 0, 0), (20, 0, 0), (0, 20, 0), (0, 0, 20)):
                file.write(f'<vertex x="{x}" y="{y}" z="{z}"/>'.encode())
            more = b'<vertex x="1" y="1" z="1"/>' * 1000
            for _ in range(vertices // 1000):
                file.write(more)
            file.write(b"</vertices><triangles>")
            for a, b, c in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)):
                file.write(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>'.encode())
            file.write(b'</triangles></mesh></object></resources><build><item objectid="1"/></build></model>')
        return path

    return make


def ascii_stl(folder: Folder) -> Path:
    """As many triangles as fit into the largest file that is read."""
    one = "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    path = folder / "part.stl"
    path.write_text("solid a\n" + one * (59_000_000 // len(one)) + "endsolid a\n")
    return path


def wide_obj(folder: Folder) -> Path:
    """As many corners as fit into the largest file that is read."""
    path = folder / "part.obj"
    path.write_text("v 1 2 3\n" * 7_000_000 + "f 1 2 3\n")
    return path


def step(shape: Callable[[], Any], scale: str = "") -> Callable[[Folder], Path]:
    """A STEP file of a shape.

    Args:
        scale: What the file says its unit is, in place of mm.
    """

    def make(folder: Folder) -> Path:
        from build123d import export_step

        path = folder / "part.step"
        export_step(shape(), path)
        if scale:
            path.write_text(path.read_text().replace("SI_UNIT(.MILLI.,.METRE.)", scale))
        return path

    return make


def plate() -> Any:
    from build123d import Box, Cylinder

    return Box(60, 40, 20) - Cylinder(5, 20)


def box(x: float, y: float, z: float) -> Callable[[], Any]:
    def make() -> Any:
        from build123d import Box

        return Box(x, y, z)

    return make


def open_box() -> Any:
    from build123d import Box, Shell

    return Shell(Box(20, 20, 20).faces()[:5])


def reversed_plate() -> Any:
    from build123d import Solid

    return Solid(plate().solid().wrapped.Reversed())


def bow_tie() -> Any:
    """A prism over an outline that crosses itself."""
    from build123d import Face, Solid, Vector, Wire

    outline = Wire.make_polygon([(0, 0), (40, 30), (40, 0), (0, 20)])
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Dir, gp_Pln, gp_Pnt

    face = Face(BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), outline.wrapped, True).Face())
    return Solid.extrude(face, Vector(0, 0, 10))


def through_each_other() -> Any:
    from build123d import Box, Compound, Pos

    return Compound(children=[Box(20, 20, 20), Pos(3, 2, 1) * Box(10, 10, 40)])


def spline_plate() -> Any:
    """Flat and round faces, all stored as splines."""
    from build123d import Solid
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert

    return Solid(BRepBuilderAPI_NurbsConvert(plate().solid().wrapped).Shape())


def free_form() -> Any:
    """A block with a wavy top."""
    from build123d import Face, Vector, extrude

    x = np.linspace(-30, 30, 9)
    points = [[Vector(a, b, 20 + 3 * np.sin(a / 8) * np.cos(b / 9)) for a in x] for b in x]
    return extrude(Face.make_surface_from_array_of_points(points), dir=(0, 0, -1), amount=15)


def wire() -> Any:
    from build123d import Wire

    return Wire.make_polygon([(0, 0), (40, 30), (40, 0)])


def sheet_step() -> Any:
    from build123d import Face

    return Face.make_rect(40, 30)


def perforated() -> Any:
    from build123d import Box, Cylinder, GridLocations

    return Box(170, 170, 5) - [where * Cylinder(2.5, 5) for where in GridLocations(8, 8, 20, 20)]


def faceted(many: int) -> Callable[[], Any]:
    """A mesh as programs save it as STEP: a plane for each triangle."""

    def make() -> Any:
        from build123d import Face, Shell, Solid, Wire

        given = triangles(Manifold.sphere(30, many))
        faces = [Face(Wire.make_polygon([tuple(map(float, p)) for p in each])) for each in given]
        return Solid(Shell(faces))

    return make


def half(folder: Folder) -> Path:
    path = step(plate)(folder)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    return path


def points(folder: Folder) -> Path:
    """More than fit into the largest file that is read."""
    path = folder / "part.step"
    lines = (f"#{i}=CARTESIAN_POINT('',(1.,2.,3.));\n" for i in range(1, 1_500_000))
    path.write_text("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n" + "".join(lines) + "ENDSEC;\nEND-ISO-10303-21;\n")
    return path


_NO_DATA = "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=GARBAGE(#2);\nENDSEC;\nEND-ISO-10303-21;\n"
CASES: Mapping[str, Case] = {
    "STL, a plate of 40 mm with a hole": Case(stl(lambda: bored((40, 30, 10), 4))),
    "STL, the same in metres": Case(stl(lambda: bored((40, 30, 10), 4), 1e-3)),
    "STL, the same in metres, `--unit m`": Case(stl(lambda: bored((40, 30, 10), 4), 1e-3), ("--unit", "m")),
    "STL, the same in mm, `--unit m`": Case(stl(lambda: bored((40, 30, 10), 4)), ("--unit", "m")),
    "STL, the same in inches": Case(stl(lambda: bored((40, 30, 10), 4), 1 / 25.4)),
    "STL, `--unit yard`": Case(stl(lambda: bored((40, 30, 10), 4)), ("--unit", "yard")),
    "STL, 2 m long": Case(stl(lambda: bored((2000, 40, 20), 4))),
    "STL, 2.5 m long": Case(stl(lambda: bored((2500, 40, 20), 4)), ("--unit", "mm")),
    "STL, 1 mm long": Case(stl(lambda: bored((1, 0.8, 0.4), 0.1)), ("--unit", "mm")),
    "STL, 0.1 mm long": Case(stl(lambda: bored((0.1, 0.08, 0.04), 0.01)), ("--unit", "mm")),
    "STL, open shell": Case(stl(opened)),
    "STL, inside out": Case(stl(inside_out)),
    "STL, a third of the triangles turned round": Case(stl(mixed)),
    "STL, crosses itself": Case(stl(crossed)),
    "STL, two solids with a common side": Case(stl(touching)),
    "STL, a sheet without room inside": Case(stl(sheet)),
    "STL, a corner that is no number": Case(stl(infinite)),
    "STL, crumpled at random, 20,000 triangles": Case(stl(crumpled)),
    "STL, 200,000 triangles, a ball": Case(stl(lambda: Manifold.sphere(30, 632))),
    "STL, 200,000 triangles, flat faces and a hole": Case(stl(lambda: bored((60, 40, 20), 5).refine_to_length(_FINE))),
    "STL, the same as slivers": Case(stl(lambda: bored((60, 40, 20), 5).refine(28))),
    "STL, 800,000 triangles": Case(stl(lambda: Manifold.sphere(30, 1265))),
    "STL, a plate with 400 holes": Case(stl(sieve)),
    "STL, 59 MB of text": Case(ascii_stl),
    "STL, a file of 10 GB": Case(sparse("part.stl", 10_000_000_000)),
    "STL, empty file": Case(text("part.stl", "")),
    "STL, a letter": Case(text("part.stl", _TEXT)),
    "STL, bytes at random": Case(text("part.stl", np.random.default_rng(18).bytes(20_000))),
    "STL, a pipe": Case(pipe("part.stl")),
    "STL, a folder": Case(folder_named("part.stl")),
    "STL, a link to a device": Case(link("part.stl", "/dev/zero")),
    "OBJ, a letter": Case(text("part.obj", _TEXT)),
    "OBJ, 56 MB of corners": Case(wide_obj),
    "3MF, no archive": Case(text("part.3mf", _TEXT)),
    "3MF, 2,000,000 corners in a small archive": Case(three_mf(2_000_000)),
    "3MF, 20,000,000 corners in a small archive": Case(three_mf(20_000_000)),
    "STEP, a plate of 60 mm with a hole": Case(step(plate)),
    "STEP, the same, which says metres": Case(step(plate, "SI_UNIT($,.METRE.)")),
    "STEP, the same, which says centimetres": Case(step(plate, "SI_UNIT(.CENTI.,.METRE.)")),
    "STEP, `--unit in`": Case(step(plate), ("--unit", "in")),
    "STEP, 2 m long": Case(step(box(2000, 40, 20))),
    "STEP, 2.5 m long": Case(step(box(2500, 40, 20))),
    "STEP, 1 mm long": Case(step(box(1, 0.8, 0.4))),
    "STEP, 0.1 mm long": Case(step(box(0.1, 0.08, 0.04))),
    "STEP, open shell": Case(step(open_box)),
    "STEP, inside out": Case(step(reversed_plate)),
    "STEP, an outline that crosses itself": Case(step(bow_tie)),
    "STEP, two solids that go through each other": Case(step(through_each_other)),
    "STEP, flat and round faces stored as splines": Case(step(spline_plate)),
    "STEP, a block with a wavy top": Case(step(free_form)),
    "STEP, curves only": Case(step(wire)),
    "STEP, a sheet": Case(step(sheet_step)),
    "STEP, a plate with 400 holes": Case(step(perforated)),
    "STEP, a mesh as 2,000 flat faces": Case(step(faceted(64))),
    "STEP, half of a file": Case(half),
    "STEP, 65 MB of points": Case(points),
    "STEP, a file of 10 GB": Case(sparse("part.step", 10_000_000_000)),
    "STEP, no shape in it": Case(text("part.step", _NO_DATA)),
    "STEP, empty file": Case(text("part.step", "")),
    "STEP, a letter": Case(text("part.step", _TEXT)),
    "STEP, a pipe": Case(pipe("part.step")),
    "a letter, `.docx`": Case(text("part.docx", _TEXT)),
    "no such file": Case(lambda folder: folder / "part.stl"),
}
