"""Write the kit of a scenario for a real robot: parts to print, a base plate with tags, and a form for results."""

from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Solid, shrink_pieces
from apo_bench.io import write_csv, write_file
from apo_bench.scenario import Scenario

FORM_COLUMNS = {
    name: (name, 1.0)
    for name in (
        *("scenario", "clearance_mm", "trial", "method", "demonstration_right", "ended", "at_rest"),
        *("fit_gap_mm", "support_gap_mm", "overlap_percent", "slid_mm", "note"),
    )
}
"""Columns of the results form, as `read_csv` takes them; the kit fills in those up to `method`."""
FORM_NAME = "form.csv"  # the results form
TAG_FAMILY = "tag36h11"  # of AprilTag
TAG_EDGE_MM = 30.0  # edge of the black border of a tag, as tag detectors count it
_TAG_PAPER_MM = 38.0  # edge of the paper of a tag, with a white margin of one module
_TAG_AT_MM = 80.0  # distance of a tag's centre from the plate's, along x and along y
_RECESS_MM = 0.4  # depth of the recess for the paper of a tag: two layers of most printers
_PLATE_MM = 200.0  # edge of the square plate
_PLATE_THICK_MM = 10.0
_MM = 1e3  # mm in a metre
_DECIMALS = 6  # of coordinates in mm, so that equal corners of neighbouring pieces are equal numbers


def write_kit(
    scenario: Scenario, clearance_mm: float, folder: Path, methods: Sequence[str], trials: int, step: bool
) -> Mapping[Path, int]:
    """Write STL files, STEP files if asked for, `tags.csv` and `form.csv` into a folder.

    Args:
        clearance_mm: Clearance per side, by which each face that fits recedes.
        methods: Methods to compare; the form has one line per method and trial.
        trials: Trials of each method.
        step: Whether to write each part as STEP too.

    Returns:
        File of a part or of the plate -> number of copies to print.

    Raises:
        InputError: The clearance suits no part, STEP files need a package, or a file cannot be written.
    """
    require(not step or find_spec("build123d"), "writing STEP needs the extra cad; run: pip install 'apo_bench[cad]'")
    assembly = scenario.assembly
    printed = Counter(scenario.part_files[part].stem for part in assembly.solids if part != "table")
    solids = {scenario.part_files[part].stem: solid for part, solid in assembly.solids.items()}
    meshes = {name: make_part_mesh(solids[name], clearance_mm) for name in printed}
    if "table" in assembly.solids:
        meshes["plate"] = make_plate_mesh(scenario, clearance_mm)
        printed["plate"] = 1
    folder.mkdir(parents=True, exist_ok=True)
    files = {}
    for name, mesh in meshes.items():
        path = folder / f"{name}.stl"
        write_file(path, mesh.export(file_type="stl"))
        files[path] = printed[name]
        if step:
            _write_step(mesh, path.with_suffix(".step"))
    write_csv(folder / "tags.csv", ("family", "id", "edge_mm", "x_mm", "y_mm", "z_mm"), _list_tags())
    lines = [(scenario.name, clearance_mm, k, method) for k in range(1, trials + 1) for method in methods]
    write_csv(folder / FORM_NAME, tuple(FORM_COLUMNS), [(*line, *[""] * (len(FORM_COLUMNS) - 4)) for line in lines])
    return files


def make_part_mesh(solid: Solid, clearance_mm: float) -> Any:
    """Return a part as printed, a closed trimesh mesh, [mm]; round faces have flat sides.

    Raises:
        InputError: The pieces of the part do not make one closed solid.
    """
    import trimesh
    from manifold3d import Manifold, OpType

    # neighbouring pieces only join if their common corners are equal to the last bit
    corners = [np.round(_MM * piece.corners, _DECIMALS) for piece in shrink_pieces(solid, clearance_mm / _MM)]
    mesh = Manifold.batch_boolean([Manifold.hull_points(each) for each in corners], OpType.Add).to_mesh64()
    printable = trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts)
    require(
        printable.is_watertight and printable.body_count == 1,
        f"part '{solid.name}' is not one closed solid at a clearance of {clearance_mm:g} mm; choose another scenario, "
        "or a smaller clearance.",
    )
    return printable


def make_plate_mesh(scenario: Scenario, clearance_mm: float) -> Any:
    """Return the base plate, a trimesh mesh, [mm]: the middle of the table with four recesses for tags, top at z = 0.

    The origin of the plate's frame is its middle: the target of the last operation, in x and y of the assembly's frame.
    """
    from trimesh.boolean import difference, intersection
    from trimesh.creation import box

    middle = np.append(_MM * scenario.nominal_poses[-1][:2, 3], 0.0)
    table = make_part_mesh(scenario.assembly.solids["table"], clearance_mm).apply_translation(-middle)
    plate = box(bounds=((-_PLATE_MM / 2, -_PLATE_MM / 2, -_PLATE_THICK_MM), (_PLATE_MM / 2, _PLATE_MM / 2, 0.0)))
    papers = [
        box((_TAG_PAPER_MM, _TAG_PAPER_MM, 2 * _RECESS_MM)).apply_translation((x, y, 0)) for *_, x, y, _ in _list_tags()
    ]
    return difference([intersection([plate, table]), *papers])


def _list_tags() -> list[tuple[str, int, float, float, float, float]]:
    """Return family, id, edge and position on the plate of each tag, [mm]."""
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return [(TAG_FAMILY, k, TAG_EDGE_MM, x * _TAG_AT_MM, y * _TAG_AT_MM, -_RECESS_MM) for k, (x, y) in enumerate(signs)]


def _write_step(mesh: Any, path: Path) -> None:
    """Write a mesh as a STEP solid, with coplanar triangles merged into one face."""
    from build123d import Face, Shell, Solid, Wire, export_step

    faces = [Face(Wire.make_polygon([tuple(corner) for corner in triangle])) for triangle in mesh.triangles]
    export_step(Solid(Shell(faces)).clean(), path)
