"""3MF files: objects of several models are placed, supports left out, and what is no 3MF file is refused."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.importers.cad.meshes.three_mf import read_3mf

TETRAHEDRON = (
    "<mesh><vertices>"
    + "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in ((0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10)))
    + "</vertices><triangles>"
    + "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    + "</triangles></mesh>"
)
MESH = f'<object id="1">{TETRAHEDRON}</object>'


def model(objects: str, items: str = '<item objectid="1"/>', head: str = "") -> str:
    return f'{head}<model unit="millimeter"><resources>{objects}</resources><build>{items}</build></model>'


def packed(text: str) -> bytes:
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", text)
    return out.getvalue()


def refers(number: int, *inner: int) -> str:
    components = "".join(f'<component objectid="{each}"/>' for each in inner)
    return f'<object id="{number}"><components>{components}</components></object>'


def chain(depth: int, times: int, innermost: str = MESH) -> str:
    """Objects 2, 3, ..., each so many times the one before; the last one is placed."""
    objects = innermost + "".join(refers(n, *[n - 1] * times) for n in range(2, depth + 1))
    return model(objects, f'<item objectid="{depth}"/>')


REFUSED: dict[str, tuple[Callable[[], bytes], str]] = {
    "a long chain": (lambda: packed(chain(5000, 1)), "no 3MF file that can be read"),
    "no XML": (lambda: packed("<model><"), "no 3MF file that can be read"),
    "a word": (lambda: packed(model(MESH.replace('"10"', '"ten"'))), "no 3MF file that can be read"),
    "no such corner": (lambda: packed(model(MESH.replace('v1="1"', 'v1="4"'))), "no 3MF file that can be read"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_3mf_file_is_refused_in_one_sentence(case: str) -> None:
    make, sentence = REFUSED[case]
    with pytest.raises(InputError, match=sentence) as raised:
        read_3mf(Path("a.3mf"), make())
    assert "\n" not in str(raised.value)


def test_a_unit_and_names_are_those_of_the_file() -> None:
    text = model(MESH.replace("<object ", '<object name="brick" ')).replace("millimeter", "inch")
    unit, meshes, _ = read_3mf(Path("a.3mf"), packed(text))
    assert (unit, [name for name, _ in meshes]) == ("in", ["brick"])


def test_nested_objects_are_placed_by_the_product_of_their_places() -> None:
    move = "1 0 0 0 1 0 0 0 1 5 0 0"
    turn = "0 1 0 -1 0 0 0 0 1 0 0 0"
    inner = f'<object id="2"><components><component objectid="1" transform="{move}"/></components></object>'
    raw = packed(model(MESH + inner, f'<item objectid="2" transform="{turn}"/>'))
    [(name, mesh)] = read_3mf(Path("a.3mf"), raw)[1]
    assert name == "object1"
    assert mesh.corners[:2].tolist() == [[0.0, 5.0, 0.0], [0.0, 15.0, 0.0]]


PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"


def box(number: int, x: float, y: float, z: float, kind: str = "") -> str:
    """An object that is a box."""
    corners = [(a, b, c) for c in (0, z) for a, b in ((0, 0), (x, 0), (x, y), (0, y))]
    quads = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    vertices = "".join(f'<vertex x="{a}" y="{b}" z="{c}"/>' for a, b, c in corners)
    triangles = "".join(f'<triangle v1="{q[0]}" v2="{q[k]}" v3="{q[k + 1]}"/>' for q in quads for k in (1, 2))
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    return f'<object id="{number}" type="{kind or "model"}">{mesh}</object>'


def several(**models: str) -> bytes:
    """A file of several models; its relationships name the one called root, which comes last by its name."""
    names = {"root": "3D/z.model"}
    target = '<Relationship Target="/3D/z.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("_rels/.rels", f"<Relationships>{target}</Relationships>")
        for name, text in models.items():
            archive.writestr(names.get(name, f"3D/Objects/{name}.model"), text)
    return out.getvalue()


def of_production(objects: str, items: str = "", required: str = "p", unit: str = "millimeter") -> str:
    head = f'xmlns:p="{PRODUCTION}" xmlns:b="http://example.com/lattice" requiredextensions="{required}"'
    return f'<model unit="{unit}" {head}><resources>{objects}</resources><build>{items}</build></model>'


def placed_from(number: int, path: str, x: float) -> str:
    place = f'<component p:path="/3D/Objects/{path}.model" objectid="1" transform="1 0 0 0 1 0 0 0 1 {x} 0 0"/>'
    return f'<object id="{number}"><components>{place}</components></object>'


def sizes(raw: bytes) -> list[list[float]]:
    meshes = read_3mf(Path("a.3mf"), raw)[1]
    return [(mesh.corners.max(axis=0) - mesh.corners.min(axis=0)).tolist() for _, mesh in meshes]


def test_objects_of_two_models_with_one_number_stay_two() -> None:
    items = '<item objectid="1"/><item objectid="2"/>'
    root = of_production(box(1, 5, 5, 5) + placed_from(2, "pin", 60), items)
    assert sizes(several(root=root, pin=of_production(box(1, 12, 12, 40)))) == [[5, 5, 5], [12, 12, 40]]


@pytest.mark.parametrize("kind", ["support", "other"])
def test_supports_are_left_out_and_counted_also_where_an_object_around_them_is_one(kind: str) -> None:
    around = refers(3, 1).replace("<object ", f'<object type="{kind}" ')
    items = "".join(f'<item objectid="{number}"/>' for number in (1, 2, 3))
    raw = packed(model(box(1, 5, 5, 5, "model") + box(2, 9, 9, 9, kind) + around, items))
    _, meshes, left_out = read_3mf(Path("a.3mf"), raw)
    assert (len(meshes), left_out) == (1, 2)
    with pytest.raises(InputError, match="all that the 3MF file places are supports"):
        read_3mf(Path("a.3mf"), packed(model(box(1, 5, 5, 5, kind))))


@pytest.mark.parametrize(
    ("root", "sentence"),
    [
        (of_production(placed_from(2, "gone", 0), '<item objectid="2"/>'), "are in mm and in|are in in and mm"),
        (of_production(box(1, 5, 5, 5), '<item objectid="1"/>', "p b"), "needs the extension 'b'"),
    ],
)
def test_what_would_give_other_shapes_is_refused(root: str, sentence: str) -> None:
    raw = several(root=root, inch=of_production(box(1, 5, 5, 5), unit="inch"))
    with pytest.raises(InputError, match=sentence) as raised:
        read_3mf(Path("a.3mf"), raw)
    assert "\n" not in str(raised.value)
