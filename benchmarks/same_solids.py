"""Whether one solid has the same faces in every form of file: `python -m benchmarks.same_solids [WORD ...]`.

Thirty solids (`same_drawn.py`) are written as STEP, as STL as build123d tessellates them, remeshed, subdivided,
decimated to 200 triangles, and with noise of 0.01 mm on each coordinate of each corner (`same_forms.py`). Each file is
imported. The faces are those that a person counts in the drawing, placed as its STEP file has them: a face is found if
one face of the import is of its kind, size and place; a cell is whole if all are, no other one can touch, and radii are
within 0.02 mm, of decimated meshes within what decimating moved the wall. `--form FORM` takes one form, `--faces` does
not cut into pieces, `--page` writes `docs/results/same-solids.md`. Needs the extra `cad`; half an hour on one core.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import zlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.importing import import_part, raw_solids
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region
from apo_bench.errors import InputError
from benchmarks.same_drawn import DRAWN, Drawn
from benchmarks.same_forms import decimated, joined, noisy, remeshed, subdivided

FORMS = ("STEP", "STL", "remeshed", "subdivided", "decimated", "noisy")
SAGITTA_MM = 0.02
ANGLE_RAD = 0.2
MOST_TRIANGLES = 200
NOISE_MM = 0.01
RADIUS_MM = 0.02
_PLACE_MM = 0.06
_TURNED = 0.01
_AREA = 0.15
"""How far a face may be from where it is, how far it may be turned, and what of its area may be in others."""


PAGE = Path(__file__).parents[1] / "docs" / "results" / "same-solids.md"
_LONGEST = 160
_WHY = """\
With holes of 12 sides the gear of 12 teeth takes 240 triangles, that of 20 teeth 368, the flange with its 18 circles
456: what 200 triangles leave of them is off by up to 1.3 mm. The holes of the plate with round corners have 8 sides
then; fewer than 12 are flat faces, as [the guide](../guide/part.md#from-a-cad-file) says. Fillets
of 5 sides are so many flat faces, too. A flank of the gear of 20 teeth is 1.9 mm wide, so that noise of 0.01 mm on its
four corners turns it by 0.005 rad, root mean square; 4 of 80 are turned by more than the 0.01 rad that are allowed.
"""


class Cell(NamedTuple):
    """One file."""

    said: str
    """What was wrong; empty: whole."""
    flats: int
    rounds: int
    touch: int
    """Faces that were found: flat ones, round ones, and those of them that can touch."""
    radius_mm: float
    """The most that a radius is off."""
    seconds: float


def write_forms(drawn: Drawn, folder: Path, name: str) -> dict[str, tuple[Path, float]]:
    """The file of each form, and what decimating moved, [mm]."""
    from build123d import export_step, export_stl

    from tests.cad.made import write_triangles

    files = {form: (folder / f"{form}.{'step' if form == 'STEP' else 'stl'}", RADIUS_MM) for form in FORMS}
    export_step(drawn.shape, files["STEP"][0])
    export_stl(drawn.shape, files["STL"][0], SAGITTA_MM, ANGLE_RAD)
    import trimesh

    loaded: Any = trimesh.load(files["STL"][0], process=False)
    mesh = joined(np.asarray(loaded.vertices), np.asarray(loaded.faces))
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    size = float(np.ptp(mesh[0], axis=0).max())
    fine = remeshed(*mesh, size / 14.0, rng)
    coarse = decimated(*mesh, MOST_TRIANGLES)
    for form, each in (
        ("remeshed", fine),
        ("subdivided", subdivided(*mesh)),
        ("decimated", coarse),
        ("noisy", noisy(*mesh, NOISE_MM, rng)),
    ):
        write_triangles(each[0][each[1]], files[form][0])
    files["decimated"] = (files["decimated"][0], RADIUS_MM + _moved(mesh, coarse))
    return files


def kept_forms(drawn: Drawn, folder: Path, name: str) -> dict[str, tuple[Path, float]]:
    """Files of an earlier run, or new ones."""
    known = folder / "decimated.txt"
    if not known.exists():
        folder.mkdir(parents=True, exist_ok=True)
        files = write_forms(drawn, folder, name)
        known.write_text(repr(files["decimated"][1]))
    allowed = dict.fromkeys(FORMS, RADIUS_MM) | {"decimated": float(known.read_text())}
    return {form: (folder / f"{form}.{'step' if form == 'STEP' else 'stl'}", allowed[form]) for form in FORMS}


def _moved(mesh: tuple[Any, Any], coarse: tuple[Any, Any]) -> float:
    """The farthest that a corner of the tessellation is from the decimated mesh, [mm]."""
    a, b, c = (coarse[0][coarse[1][:, k]] for k in range(3))
    share = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), 200)
    from scipy.spatial import cKDTree

    samples = np.einsum("sk,ktx->tsx", share, np.stack([a, b, c])).reshape(-1, 3)
    farthest = 0.0
    for near, point in zip(cKDTree(samples).query(mesh[0], k=8)[1], mesh[0], strict=True):
        t = np.unique(near // len(share))
        farthest = max(farthest, min(_distance(point, a[i], b[i], c[i]) for i in t))
    return farthest


def _distance(p: Any, a: Any, b: Any, c: Any) -> float:
    """Of a point from a triangle."""
    n = np.cross(b - a, c - a)
    inside = all(np.cross(v - u, p - u) @ n >= 0.0 for u, v in ((a, b), (b, c), (c, a)))
    if inside:
        return float(abs((p - a) @ n) / np.linalg.norm(n))
    ways = []
    for u, v in ((a, b), (b, c), (c, a)):
        s = np.clip((p - u) @ (v - u) / max(float((v - u) @ (v - u)), 1e-300), 0.0, 1.0)
        ways.append(float(np.linalg.norm(p - u - s * (v - u))))
    return min(ways)


def area_of(raw: RawSolid, region: Region) -> float:
    return float(np.linalg.norm(raw.mesh.across[region.triangles], axis=1).sum() / 2.0)


def is_same(truth: tuple[RawSolid, Region], found: tuple[RawSolid, Region], radius_mm: float) -> bool:
    """Whether a face of an import is one of the drawing."""
    a, b = truth[1], found[1]
    if a.kind != b.kind or abs(area_of(*truth) - area_of(*found)) > _AREA * area_of(*truth):
        return False
    near = _PLACE_MM + (radius_mm - RADIUS_MM)
    middle = truth[0].mesh.corners[np.unique(truth[0].mesh.triangles[a.triangles])].mean(axis=0)
    if a.kind == "plane":
        offset = abs(float((middle - b.point) @ b.direction))
        return bool(np.linalg.norm(a.direction - b.direction) < _TURNED and offset < near)
    beside = float(b.polar(middle[None])[1][0]) if a.is_whole else 0.0
    turned = float(np.linalg.norm(np.cross(a.direction, b.direction)))
    return a.hole == b.hole and a.is_whole == b.is_whole and turned < _TURNED and beside < near + 0.05 * max(a.radii)


def compared(truth: RawSolid, found: RawSolid, allowed_mm: float, touch: Iterable[str]) -> tuple[list[str], Cell]:
    """What differs, and the numbers."""
    touch = set(touch)
    wanted = [r for r in truth.regions if r.name]
    left = [r for r in found.regions if r.name]
    said, flats, rounds, can_touch, off = [], 0, 0, 0, 0.0
    for face in wanted:
        match = next((r for r in left if is_same((truth, face), (found, r), allowed_mm)), None)
        if match is None:
            said.append(f"{face.name} missing")
            continue
        left.remove(match)
        if face.is_round:
            error = abs(sum(face.radii) - sum(match.radii)) / 2.0
            off = max(off, error)
            if error > allowed_mm:
                said.append(f"{face.name} off by {error:.3f}")
                continue
        rounds += face.is_round
        flats += not face.is_round
        if match.name in touch:
            can_touch += 1
        else:
            said.append(f"{face.name} cannot touch")
    wrong = [r.name for r in left if r.name in touch]
    if wrong:
        said.append(f"{len(wrong)} too many")
    return said, Cell("; ".join(said), flats, rounds, can_touch, off, 0.0)


def cell(path: Path, truth: RawSolid | None, allowed_mm: float, only_faces: bool) -> tuple[Cell, RawSolid | None]:
    """Import one file."""
    start = time.process_time()
    raw = None
    try:
        _, raws = raw_solids(path, None if path.suffix == ".step" else "mm")
        raw = raws[0]
        if len(raws) > 1:
            return Cell(f"{len(raws)} solids", 0, 0, 0, 0.0, time.process_time() - start), raw
        touch: Iterable[str] = raw.named()
        if not only_faces:
            with tempfile.TemporaryDirectory() as folder:
                done = import_part(raw, "part", Path(folder), path.name, 8000.0)
                touch = {*done.solid.faces, *done.solid.rounds}
        raw = placed(raw)
        _, found = compared(truth or raw, raw, allowed_mm, touch)
    except InputError as error:
        found = Cell(str(error).replace(f"{path.parent}/", ""), 0, 0, 0, 0.0, 0.0)
    except Exception as error:
        found = Cell(f"TRACEBACK {type(error).__name__}: {error}", 0, 0, 0, 0.0, 0.0)
    return found._replace(seconds=time.process_time() - start), raw


def placed(raw: RawSolid) -> RawSolid:
    """Where the file has it."""
    R, at = raw.places[0].T[:3, :3], raw.places[0].T[:3, 3]
    regions = [replace(r, direction=R @ r.direction, point=R @ r.point + at) for r in raw.regions]
    return replace(raw, mesh=Mesh(raw.mesh.corners @ R.T + at, raw.mesh.triangles), regions=tuple(regions))


def is_counted(raw: RawSolid, drawn: Drawn) -> bool:
    """Whether an import has the faces that a person counts."""
    whole = [r for r in raw.regions if r.is_whole]
    radii = [sorted(r.radii[0] for r in whole if r.kind == "cylinder" and r.hole == hole) for hole in (True, False)]
    return (
        sum(r.kind == "plane" for r in raw.regions) == drawn.flats
        and sum(r.kind == "cone" for r in whole) == drawn.cones
        and all(
            len(have) == len(want) and np.allclose(have, sorted(want), atol=1e-3)
            for have, want in zip(radii, (drawn.holes, drawn.shafts), strict=True)
        )
    )


def measured(
    words: Sequence[str], forms: Sequence[str], only_faces: bool, keep: Path | None
) -> dict[str, dict[str, Cell]]:
    """Every cell, printed as it comes."""
    table: dict[str, dict[str, Cell]] = defaultdict(dict)
    for name, draw in DRAWN.items():
        if words and not any(word in name for word in words):
            continue
        drawn = draw()
        with tempfile.TemporaryDirectory() as temporary:
            files = kept_forms(drawn, (keep or Path(temporary)) / name.replace(" ", "_").replace(",", ""), name)
            exact, truth = cell(files["STEP"][0], None, RADIUS_MM, only_faces)
            if truth is None or not is_counted(truth, drawn):
                exact = exact._replace(said=f"not the faces of the drawing {exact.said}")
            table[name]["STEP"] = exact
            for form in forms:
                path, allowed = files[form]
                each = exact if form == "STEP" else cell(path, truth, allowed, only_faces)[0]
                table[name][form] = each
                print(f"{name:22} {form:10} {each.seconds:5.1f} s  {each.said or 'whole'}"[:230], flush=True)
    return table


def lines(table: dict[str, dict[str, Cell]], forms: Sequence[str]) -> Iterable[str]:
    """The table in Markdown: faces found and stated of those of the STEP file, and the worst radius."""
    yield f"| solid | {' | '.join(forms)} |"
    yield "|---" * (len(forms) + 1) + "|"
    for name, row in table.items():
        want = row["STEP"].flats + row["STEP"].rounds
        cells = []
        for form in forms:
            each = row[form]
            count = f"{each.flats + each.rounds}/{want}" + ("" if each.touch == want else f", {each.touch} touch")
            cells.append(("" if not each.said else "**no** ") + count)
        yield f"| {name} | {' | '.join(cells)} |"
    whole = [f"{sum(not row[form].said for row in table.values())} of {len(table)}" for form in forms]
    yield f"| whole | {' | '.join(whole)} |"
    worst = [f"{max((row[form].radius_mm for row in table.values()), default=0.0):.3f}" for form in forms]
    yield f"| worst radius, mm | {' | '.join(worst)} |"


def page(table: dict[str, dict[str, Cell]], forms: Sequence[str]) -> str:
    """docs/results/same-solids.md."""
    rows = "\n".join(lines(table, forms))
    missed = [f"- {name}, {form}: {row[form].said}" for name, row in table.items() for form in forms if row[form].said]
    said = "\n".join(line if len(line) < _LONGEST else f"{line[:_LONGEST]} ..." for line in missed)
    return f"""# One solid in every form of file

Written by `python -m benchmarks.same_solids --faces --page`: {len(table)} solids that a script draws go through the
reader of CAD files in {len(forms)} forms: as STEP; as STL; remeshed, with corners anywhere on the walls and long edges
across them; subdivided; decimated to {MOST_TRIANGLES} triangles; and with noise of {NOISE_MM:g} mm on each coordinate
of each corner. Faces are those that a person counts in the drawing. A cell says how many of them were found, of the
same kind, size and place; **no** stands where one is missing, or is there that is none, or a radius is off by more than
{RADIUS_MM:g} mm (decimated: by more than decimating moved the wall).

{rows}

## What is missing, and why

{said or "Nothing."}

{_WHY}"""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("words", nargs="*", help="in the names of the solids; default: all")
    asked.add_argument("--form", action="append", choices=FORMS, help="default: all")
    asked.add_argument("--faces", action="store_true", help="only the faces, no pieces")
    asked.add_argument("--keep", type=Path, help="a folder for the files, which are taken from there the next time")
    asked.add_argument("--page", action="store_true", help="write the page of the results")
    given = asked.parse_args()
    forms = given.form or FORMS
    table = measured(given.words, forms, given.faces, given.keep)
    print("\n".join(lines(table, forms)))
    if given.page:
        PAGE.write_text(page(table, forms), encoding="utf-8")
    if any(each.said.startswith("TRACEBACK") for row in table.values() for each in row.values()):
        sys.exit("an import ended in a traceback")


if __name__ == "__main__":
    main()
