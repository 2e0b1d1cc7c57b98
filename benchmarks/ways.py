"""Assemblies that ask for other ways than a hand from above: `python benchmarks/ways.py [--out OUT] [--seeds 5]`.

Twenty are drawn with sizes by one seed: pins to pinch, parts beside or below walls that want a tilted hand, ways in
along slopes, and parts that do not stand as they will be put. Each is written as STL, a file for each part, drafted
without a hand, checked, and put together by `oracle`; a table, and every sentence of what was refused or found wrong.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.drafting.checking import check_file
from apo_bench.drafting.from_cad import import_assembly
from apo_bench.drafting.posed import PosedPart, read_posed
from apo_bench.drafting.upright import drafted
from apo_bench.drafting.writing import write_scenario
from apo_bench.errors import InputError
from benchmarks.generated import rate

_SEED = 33
_PLAY = 0.3
"""Per side, between what goes into what, [mm]."""
_SIDES = 64
Mesh = trimesh.Trimesh
Bodies = Mapping[str, Mesh]
Draw = Callable[[np.random.Generator], Bodies]


def box(size: object, at: object) -> Mesh:
    """A box of a size whose lowest side has its middle at a point, [mm]."""
    s = np.asarray(size, dtype=float)
    mesh = trimesh.creation.box(s)
    mesh.apply_translation(np.add(at, (0.0, 0.0, s[2] / 2)))
    return mesh


def rod(radius: float, height: float, at: object, sides: int = _SIDES) -> Mesh:
    """An upright prism, round by default, on a point, [mm]."""
    mesh = trimesh.creation.cylinder(radius, height, sections=sides)
    mesh.apply_translation(np.add(at, (0.0, 0.0, height / 2)))
    return mesh


def cut(mesh: Mesh, *others: Mesh) -> Mesh:
    return trimesh.boolean.difference([mesh, *others])


def joined(*meshes: Mesh) -> Mesh:
    return trimesh.boolean.union(list(meshes))


def leaned(mesh: Mesh, degrees: float, about: object = (0.0, 0.0, 0.0)) -> Mesh:
    """Turned about the y axis through a point: what looked up looks along x, too."""
    mesh = mesh.copy()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), [0, 1, 0], about))
    return mesh


def short_pin(rng: np.random.Generator, sides: int = _SIDES) -> Bodies:
    """A pin that stands proud by a few millimetres in a blind hole."""
    radius, long, proud = rng.uniform(3.5, 6.5), rng.uniform(9.0, 14.0), rng.uniform(3.0, 5.0)
    top = 24.0
    base = cut(box((70, 60, top), (0, 0, 0)), rod(radius + _PLAY, 40.0, (8, 4, top + proud - long), sides))
    return {"base": base, "pin": rod(radius, long, (8, 4, top + proud - long), sides)}


def short_plug(rng: np.random.Generator) -> Bodies:
    """A square plug in a pocket, proud by a few millimetres."""
    a, b = rng.uniform(8.0, 12.0, 2)
    long, proud = rng.uniform(9.0, 13.0), rng.uniform(3.0, 5.0)
    top = 22.0
    pocket = box((a + 2 * _PLAY, b + 2 * _PLAY, 40.0), (0, 0, top + proud - long))
    return {"base": cut(box((60, 60, top), (0, 0, 0)), pocket), "plug": box((a, b, long), (0, 0, top + proud - long))}


def disc(rng: np.random.Generator) -> Bodies:
    """A low disc in a recess."""
    radius, thick = rng.uniform(10.0, 18.0), rng.uniform(5.0, 8.0)
    top, deep = 15.0, 2.0
    base = cut(box((80, 70, top), (0, 0, 0)), rod(radius + _PLAY, 10.0, (0, 0, top - deep)))
    return {"base": base, "disc": rod(radius, thick, (0, 0, top - deep))}


def roofed(rng: np.random.Generator) -> Bodies:
    """A block below a roof that leaves less of it free than a finger is wide, slid in from the side."""
    long, wide, high = rng.uniform(36.0, 44.0), rng.uniform(20.0, 30.0), rng.uniform(18.0, 24.0)
    room = rng.uniform(4.0, 8.0)
    under = long - rng.uniform(11.0, 15.0)
    floor = box((120, 90, 10), (0, 0, 0))
    back = box((12, 90, high + room + 10), (-44, 0, 10))
    roof = box((under, 90, 10), (-38 + under / 2, 0, 10 + high + room))
    return {"base": joined(floor, back, roof), "block": box((long, wide, high), (-38 + long / 2, 0, 10))}


def towered(rng: np.random.Generator) -> Bodies:
    """A block close to a tower that is higher than fingers are long."""
    size = rng.uniform((16.0, 16.0, 14.0), (24.0, 24.0, 22.0))
    gap, high = rng.uniform(0.5, 3.0), rng.uniform(100.0, 130.0)
    base = joined(box((110, 110, 12), (0, 0, 0)), box((20, 110, high), (-30, 0, 12)))
    return {"base": base, "block": box(size, (-20 + gap + size[0] / 2, 0, 12))}


def between(rng: np.random.Generator) -> Bodies:
    """A block close to one of two towers, with the other as far as a hand is wide."""
    size = rng.uniform((16.0, 16.0, 24.0), (24.0, 24.0, 32.0))
    gap, far, high = rng.uniform(1.0, 4.0), rng.uniform(66.0, 74.0), rng.uniform(100.0, 120.0)
    base = joined(
        box((110, 150, 12), (0, 0, 0)), box((20, 150, high), (-30, 0, 12)), box((110, 20, high), (0, -65, 12))
    )
    return {"base": base, "block": box(size, (-20 + gap + size[0] / 2, -55 + far, 12))}


def leaning_plug(rng: np.random.Generator) -> Bodies:
    """A square plug in a pocket that leans; it lies against its lower wall."""
    a, b = rng.uniform(12.0, 18.0, 2)
    long, deep, lean = rng.uniform(44.0, 56.0), rng.uniform(16.0, 20.0), rng.uniform(20.0, 42.0)
    top = 44.0
    at = (0, 0, top)
    plug = leaned(box((a, b, long), (0, 0, top - deep)), lean, at)
    pocket = leaned(box((a + 2 * _PLAY, b + 2 * _PLAY, 120), (-_PLAY, 0, top - deep)), lean, at)
    return {"base": cut(box((110, 60, top), (0, 0, 0)), pocket), "plug": plug}


def leaning_block(rng: np.random.Generator) -> Bodies:
    """A block on a slope, against a lip at its lower end."""
    size = rng.uniform((26.0, 18.0, 16.0), (36.0, 30.0, 24.0))
    lean = rng.uniform(15.0, 40.0)
    at = (0, 0, 40)
    slope = leaned(box((300, 300, 100), (0, 0, 40)), lean, at)
    lip = leaned(box((10, 50, 14 + 6), (size[0] / 2 + 5, 0, 40 - 6)), lean, at)
    base = joined(cut(box((100, 70, 90), (0, 0, 0)), slope), lip)
    return {"base": base, "block": leaned(box(size, (0, 0, 40)), lean, at)}


def groove(rng: np.random.Generator) -> Bodies:
    """A square bar in a groove of two slopes, on its edge."""
    side, long = rng.uniform(16.0, 24.0), rng.uniform(34.0, 50.0)
    lean = rng.uniform(35.0, 55.0)
    at = (0, 0, 14)
    cutter = leaned(box((100, 200, 100), (50, 0, 14)), -lean, at)
    bar = leaned(box((side, long, side), (side / 2, 0, 14)), -lean, at)
    return {"base": cut(box((90, 70, 40), (0, 0, 0)), cutter), "bar": bar}


def level_pin(rng: np.random.Generator) -> Bodies:
    """A short pin in a hole of a wall, level: its own floor is near, and it is proud by less than a hand is thick."""
    radius, proud, deep = rng.uniform(5.0, 7.0), rng.uniform(22.0, 26.0), rng.uniform(30.0, 34.0)
    at = (0, 0, 90)
    pin = leaned(rod(radius, proud + deep, (0, 0, 90 - deep)), 90.0, at)
    hole = leaned(rod(radius + _PLAY, 60.0, (0, 0, 90 - deep)), 90.0, at)
    base = joined(box((110, 90, 20), (0, 0, 0)), box((45, 90, 160), (-22.5, 0, 20)))
    return {"base": cut(base, hole), "pin": pin}


def crank(rng: np.random.Generator) -> Bodies:
    """A pin with a head to one side, in a through hole: alone it falls over its shank."""
    r, long, thick = rng.uniform(4.0, 6.0), rng.uniform(16.0, 24.0), rng.uniform(12.0, 16.0)
    arm, wide, top = rng.uniform(30.0, 40.0), rng.uniform(14.0, 20.0), 30.0
    base = cut(box((90, 60, top), (0, 0, 0)), rod(r + _PLAY, 60.0, (-12, 0, -10)))
    head = box((arm, wide, thick), (-12 - wide / 2 + arm / 2, 0, top))
    return {"base": base, "crank": joined(rod(r, long, (-12, 0, top - long)), head)}


def dome(rng: np.random.Generator) -> Bodies:
    """A plug with a pointed end, in a hole."""
    r, point, long = rng.uniform(7.0, 10.0), rng.uniform(8.0, 12.0), rng.uniform(30.0, 40.0)
    top, deep = 34.0, 26.0
    cone = trimesh.creation.cone(r, point, sections=_SIDES)
    cone.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    cone.apply_translation([0, 0, top - deep + point + 0.0])
    shaft = rod(r, long, (0, 0, top - deep + point))
    shoulder = rod(r + 5.0, 8.0, (0, 0, top))
    base = cut(box((70, 60, top), (0, 0, 0)), rod(r + _PLAY, 60.0, (0, 0, top - deep - 1.0)))
    return {"base": base, "plug": joined(cone, shaft, shoulder)}


def flag(rng: np.random.Generator) -> Bodies:
    """A stem with a bar to one side, the stem in a slot."""
    stem, wide, long = rng.uniform(6.0, 9.0), rng.uniform(34.0, 44.0), rng.uniform(16.0, 22.0)
    deep, top = rng.uniform(18.0, 24.0), 32.0
    slot = box((stem + 2 * _PLAY, long + 2 * _PLAY, 60), (0, 0, top - deep - 2.0))
    part = joined(box((stem, long, deep), (0, 0, top - deep)), box((wide, long, 14.0), ((wide - stem) / 2, 0, top)))
    return {"base": cut(box((100, 60, top), (0, 0, 0)), slot), "flag": part}


def hook(rng: np.random.Generator) -> Bodies:
    """An angle that hangs over an edge, its long arm down."""
    thick, arm, hang, wide = rng.uniform(8.0, 10.0), rng.uniform(26.0, 36.0), rng.uniform(20, 26), rng.uniform(18, 26)
    top = 40.0
    part = joined(
        box((arm, wide, thick), (-arm / 2, 0, top)), box((thick, wide, hang + thick), (thick / 2, 0, top - hang))
    )
    return {"base": box((80, 70, top), (-40, 0, 0)), "hook": part}


def blade(rng: np.random.Generator) -> Bodies:
    """A thin blade upright in a slot."""
    thick, wide, high = rng.uniform(1.2, 1.6), rng.uniform(30.0, 44.0), rng.uniform(44.0, 54.0)
    top, deep = 24.0, 14.0
    slot = box((thick + 2 * _PLAY, wide + 2 * _PLAY, 80), (0, 0, top - deep))
    return {"base": cut(box((70, 80, top), (0, 0, 0)), slot), "blade": box((thick, wide, high), (0, 0, top - deep))}


DRAWS: tuple[tuple[str, Draw], ...] = (
    ("pinch: round pin a", short_pin),
    ("pinch: round pin b", short_pin),
    ("pinch: hexagonal pin", lambda rng: short_pin(rng, 6)),
    ("pinch: square plug", short_plug),
    ("pinch: disc", disc),
    ("tilt: below a roof a", roofed),
    ("tilt: below a roof b", roofed),
    ("tilt: beside a tower a", towered),
    ("tilt: beside a tower b", towered),
    ("tilt: between towers", between),
    ("way: leaning plug a", leaning_plug),
    ("way: leaning plug b", leaning_plug),
    ("way: leaning block", leaning_block),
    ("way: bar in a groove", groove),
    ("way: level pin in a high wall", level_pin),
    ("turn: crank", crank),
    ("turn: pointed plug", dome),
    ("turn: flag", flag),
    ("turn: hook", hook),
    ("turn: blade", blade),
)


class Became(NamedTuple):
    """What became of one assembly."""

    drafted: bool
    """Whether nothing is wrong with its draft, without a trial."""
    right: int
    counted: int
    said: tuple[str, ...]


def drawn(seed: int = _SEED) -> Iterator[tuple[str, Bodies]]:
    """All of them, each by its own generator, so that each stays as it is whatever becomes of the others."""
    for k, (name, make) in enumerate(DRAWS):
        yield name, make(np.random.default_rng((seed, k)))


def imported(bodies: Bodies, folder: Path) -> tuple[PosedPart, ...]:
    files = [folder / f"{body}.stl" for body in bodies]
    for file, mesh in zip(files, bodies.values(), strict=True):
        file.write_bytes(mesh.export(file_type="stl"))
    return read_posed(import_assembly(files, folder / "parts", "mm")[0])


def tried(name: str, bodies: Bodies, out: Path, seeds: int, fidelity: str) -> Became:
    """Write, draft, check and run one assembly."""
    stem = "".join(c if c.isalnum() else "_" for c in name)
    folder = out / stem
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{stem}.toml"
    try:
        made = drafted(imported(bodies, folder))
        write_scenario(made, path, name, "STL files")
    except (InputError, RuntimeError) as error:
        return Became(False, 0, 0, (str(error),))
    wrong = tuple(finding.sentence for finding in check_file(path, 0, fidelity) if not finding.ok)
    if wrong:
        return Became(False, 0, 0, (*made.notes, *wrong))
    right, counted = rate(path, "oracle", seeds, fidelity) if seeds else (0, 0)
    return Became(True, right, counted, made.notes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("ways"), help="for CAD files, part files and scenarios")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--draw", type=int, default=_SEED, help="the seed that sizes are drawn by")
    parser.add_argument("--fidelity", default="full")
    parser.add_argument("--only", default="", help="those whose name has this in it")
    asked = parser.parse_args()
    print("| assembly | drafted | oracle |\n|---|---|---|", flush=True)
    became = list[Became]()
    said = list[str]()
    for name, bodies in drawn(asked.draw):
        if asked.only in name:
            each = tried(name, bodies, asked.out, asked.seeds, asked.fidelity)
            became.append(each)
            print(f"| {name} | {'yes' if each.drafted else 'no'} | {each.right} of {each.counted} |", flush=True)
            said += [f"- {name}: {sentence}" for sentence in each.said]
    drafted, right, counted = (sum(each[i] for each in became) for i in (0, 1, 2))
    print(f"| all | {drafted} of {len(became)} | {right} of {counted} |\n\n" + "\n".join(said))


if __name__ == "__main__":
    main()
