"""Import the parts of an assembly from CAD files with one common frame, with the pose of every copy."""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array, Hull, pose
from apo_bench.importers.assembly.choices import DEFAULT_CHOICES, AssemblyChoices
from apo_bench.importers.assembly.fasteners import find_fasteners, list_held_places
from apo_bench.importers.assembly.misplaced import list_misplaced
from apo_bench.importers.assembly.posed_parts import PosedPart, read_posed
from apo_bench.importers.assembly.shaving import shave_overlaps
from apo_bench.importers.cad.fallback import import_solid_anyway
from apo_bench.importers.cad.near_points import find_near_points
from apo_bench.importers.cad.part_import import ImportedPart, import_solid, read_raw_solids
from apo_bench.importers.cad.pieces.convex_cutting import CutSolid
from apo_bench.importers.cad.pose_file import name_places, write_places
from apo_bench.importers.cad.solids import Mesh, RawSolid, Region, SolidPlace, clean_title, make_part_name

_UPRIGHT = 1.0 - 1e-9  # cosine between axis and z of an upright round face
_NEAR = 0.005
"""An axis this near to the middle of the box counts as the middle; a share of the box's larger horizontal side."""


@contextmanager
def remove_on_failure(folder: Path) -> Iterator[Path]:
    """Yield the folder for the parts; if the import fails, remove the folder unless it existed before."""
    existed = folder.exists()
    try:
        yield folder
    except BaseException:
        if not existed:
            shutil.rmtree(folder, ignore_errors=True)
        raise


class ImportedAssembly(NamedTuple):
    """The parts of an assembly after their import."""

    poses: Path
    """The file of poses, next to the part files."""
    lines: tuple[str, ...]
    """A sentence for each part, warning, face that can make no contact, and solid left out."""
    notes: tuple[str, ...]
    """Those of the lines that concern the whole assembly, for the scenario file."""


class _Report:
    """The lines of a report, each also passed on as soon as it is added."""

    def __init__(self, report: Callable[[str], object]) -> None:
        self.lines: list[str] = []
        self.notes: list[str] = []
        self._report = report

    def add(self, line: str, is_note: bool = True) -> None:
        self.lines.append(line)
        self.notes += [line] if is_note else []
        self._report(line)


def import_parts(
    files: Sequence[Path],
    folder: Path,
    unit: str | None = None,
    choices: AssemblyChoices = DEFAULT_CHOICES,
    report: Callable[[str], object] = bool,
) -> ImportedAssembly:
    """Write the parts of an assembly, each shape of a file once, and the place of every copy.

    The frame of a part is at its foot, wherever the file has its origin: a small error of an observed rotation then
    turns the part about its own frame. A solid that makes no part is left out.

    Args:
        files: One file of several solids, or several files with one common frame.
        unit: Unit of the files; None: as they state.
        report: Gets each line of the report as soon as it is known.

    Raises:
        InputError: A file cannot be read, or fewer than two solids make parts.
    """
    lines = _Report(report)
    found = list(_read_solids(files, unit, lines))
    kept, held = _leave_out_fasteners(_skip_solids(found, choices.skip, lines), choices.fasteners, lines)
    require(
        sum(len(raw.places) for _, raw in kept) > 1,
        f"{files[0]}: the file holds one solid; give a file of at least two, or further files.",
    )
    folder.mkdir(parents=True, exist_ok=True)
    places: dict[str, list[SolidPlace]] = {}
    parts: dict[Path, tuple[ImportedPart, str]] = {}
    for i, ((file, raw), others) in enumerate(zip(kept, find_near_points([raw for _, raw in kept]), strict=True)):
        name = make_part_name(raw.name, places)
        foot = _find_foot(raw)
        title = clean_title(raw.name)
        source = f"{file}, {title}"
        try:
            part = import_solid_anyway(_shift_solid(raw, -foot), name, folder, source, choices.density, others - foot)
        except InputError as error:
            lines.add(f"{title} is left out: {str(error).removeprefix(f'{source}: ')}")
            continue
        parts[part.path] = part, source
        places[name] = [
            place._replace(T=place.T @ pose.at(foot), held=(i, k) in held) for k, place in enumerate(raw.places)
        ]
        called = f" ({title})" if raw.name != name else ""
        faces = f"{len(part.solid.faces)} flat and {len(part.solid.rounds)} round faces"
        lines.add(f"{name}{called}: {faces}", is_note=False)
        for repair in part.raw.repairs:
            lines.add(f"{name}: {repair}")
        for face, why in part.refused.items():
            lines.add(f"{name}.{face} can make no contact: {why}", is_note=False)
    copies = name_places(places)
    require(len(copies) > 1, f"{files[0]}: fewer than two of its solids make parts: {'; '.join(lines.lines)}.")
    poses = write_places(copies, folder, ", ".join(file.name for file in files))
    posed = read_posed(poses, checked=False)  # each part was checked when it was written
    for misplaced in list_misplaced(posed):
        lines.add(misplaced)
    if choices.fits == "auto":
        _shave_parts(posed, parts, choices, lines)
    return ImportedAssembly(poses, tuple(lines.lines), tuple(lines.notes))


def _shave_parts(
    posed: Sequence[PosedPart],
    parts: Mapping[Path, tuple[ImportedPart, str]],
    choices: AssemblyChoices,
    lines: _Report,
) -> None:
    """Write the parts anew that overlap others beyond their faces, with the overlaps cut off.

    Args:
        parts: Part file -> the imported part, and the source that its file states.
    """
    shaved = shave_overlaps(posed, choices.clearance_mm, choices.most_overlap_mm)
    for file, pieces in shaved.pieces.items():
        part, source = parts[file]
        hulls = tuple(
            replace(piece, name="") if isinstance(piece, Hull) else Hull("", piece.corners) for piece in pieces
        )
        cut = CutSolid(hulls, 1, tuple(part.cut.filled), coarse=True)
        try:
            import_solid(part.raw, file.stem, file.parent, source, choices.density, pieces=cut)
        except InputError:
            import_solid(part.raw, file.stem, file.parent, source, choices.density, pieces=part.cut)
            lines.add(f"the overlaps of '{file.stem}' stay as drawn: cutting them off would take the part apart")
    for line in shaved.lines:
        lines.add(line)


_Found = list[tuple[str, RawSolid]]
"""Solids, each with the name of its file."""


def _read_solids(files: Sequence[Path], unit: str | None, lines: _Report) -> Iterator[tuple[str, RawSolid]]:
    """Yield the solids of the files; those that cannot be read are reported."""
    for file in files:
        source, solids = read_raw_solids(file, unit, lenient=True, is_component=len(files) > 1)
        for warning in (*source.warnings, *(f"left out: {reason}" for reason in source.left_out)):
            lines.add(f"{file.name}: {warning}")
        yield from ((file.name, raw) for raw in solids)


def _skip_solids(found: _Found, skip: Sequence[str], lines: _Report) -> _Found:
    """Return the solids whose names a user did not ask to leave out."""
    names = [make_part_name(raw.name, ()) for _, raw in found]
    for name in skip:
        require_known("part", name, {*names, *(raw.name for _, raw in found)}, place="skip")
    kept = [each for each, name in zip(found, names, strict=True) if not {name, each[1].name} & {*skip}]
    for _, raw in found:
        if all(raw is not other for _, other in kept):
            lines.add(f"{clean_title(raw.name)} is left out, as asked")
    return kept


def _leave_out_fasteners(found: _Found, choice: str, lines: _Report) -> tuple[_Found, set[tuple[int, int]]]:
    """Return the solids that are no fasteners, and the copies that fasteners hold, by index of solid and of place."""
    fasteners = find_fasteners([raw for _, raw in found]) if choice == "clamp" else {}
    kept = [each for i, each in enumerate(found) if i not in fasteners]
    for raw, why in fasteners.values():
        copies = f", {len(raw.places)} copies" if len(raw.places) > 1 else ""
        lines.add(f"{clean_title(raw.name)}{copies}: a fastener ({why}); what it holds is clamped where it is placed")
    return kept, list_held_places([raw for _, raw in kept], [raw for raw, _ in fasteners.values()])


def _find_foot(raw: RawSolid) -> Array:
    """Return the middle of the lower side of the solid's bounding box, (3,), rounded to a micrometre, [mm].

    If the axis of an upright round face passes near this middle, the axis is used: a coarse mesh of a round face has an
    asymmetric box.
    """
    low = raw.mesh.corners.min(axis=0)
    high = raw.mesh.corners.max(axis=0)
    middle = (low + high)[:2] / 2
    near = _NEAR * (high - low)[:2].max()
    upright = [r.point[:2] for r in raw.regions if r.is_round and abs(r.direction[2]) > _UPRIGHT]
    middle = next((at for at in upright if np.linalg.norm(at - middle) < near), middle)
    return np.round([*middle, low[2]], 3)


def _shift_solid(raw: RawSolid, by: Array) -> RawSolid:
    """Move a solid by a vector, (3,), [mm]."""
    mesh = Mesh(raw.mesh.corners + by, raw.mesh.triangles)
    return replace(raw, mesh=mesh, regions=tuple(_shift_region(region, by) for region in raw.regions))


def _shift_region(region: Region, by: Array) -> Region:
    """Move a region by a vector, (3,), [mm].

    The point of an axis stays the foot of the origin on the axis, so the span along the axis shifts instead.
    """
    point = region.point + by
    along = float(point @ region.direction) if region.is_round else 0.0
    low, high = region.span
    return replace(region, point=point - along * region.direction, span=(low + along, high + along))
