"""Draw finished assemblies: all scenarios, generated families, imported CAD: `python docs/gallery.py` (two minutes)."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.assembly import Assembly, compute_placements
from apo_bench.formats.kit import make_part_mesh
from apo_bench.geometry import Array, Solid, build_union_mesh, shrink_pieces
from apo_bench.resources import folder
from apo_bench.scenario import Scenario
from apo_bench.scenario.generated.families import FAMILIES
from apo_bench.scenario.scenario_file import list_scenario_names, load_scenario
from apo_bench.simulation.graphics import renderer
from apo_bench.simulation.scene.render import aim_camera
from benchmarks import generated as imported

SHEET = Path(__file__).parent / "pictures" / "scenarios.png"
GENERATED = SHEET.with_name("generated_grid.png")
IMPORTED = SHEET.with_name("generated.png")
SIZE = (1200, 960)  # rendered at this size, and reduced on the sheet
SEED = 1  # of generated assemblies
AZIMUTH_DEG = {"wedge_under_roof": -35.0}  # of the camera, where not 128
ELEVATION_DEG = -34.0
FILLED = 0.86  # share of the picture that the assembly fills, in width or height
TABLE = (0.76, 0.72, 0.67)
STEEL = (0.55, 0.57, 0.60)  # of parts without a colour
PALETTE = plt.colormaps["tab10"].colors  # of movable parts, where the scenario was imported and has no colours


def main() -> None:
    draw_sheet({name: load_scenario(name) for name in list_scenario_names()}, 5, SHEET)
    generated = {family: load_scenario(f"generated:{family}:{SEED}") for family in FAMILIES}
    draw_sheet(generated, 4, GENERATED)
    with tempfile.TemporaryDirectory() as folder:
        draw_sheet(
            {family.__name__: import_assembly(seed, Path(folder)) for seed, family in enumerate(imported.FAMILIES)},
            5,
            IMPORTED,
        )


def import_assembly(seed: int, folder: Path) -> Scenario:
    """Import an assembly of random dimensions from its part files, and give its movable parts colours."""
    scenario = load_scenario(imported.scenario_of(seed, folder / str(seed)))
    parts = [part for part in scenario.assembly.solids if part not in scenario.assembly.fixed]
    return replace(scenario, colors={part: PALETTE[k % len(PALETTE)] for k, part in enumerate(parts)})


def draw_sheet(scenarios: Mapping[str, Scenario], columns: int, path: Path) -> None:
    """Draw finished assemblies in rows, each with its name."""
    rows = -(-len(scenarios) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(2.6 * columns, 2.4 * rows), layout="constrained")
    for axis in axes.flat:
        axis.axis("off")
    for axis, (name, scenario) in zip(axes.flat, scenarios.items(), strict=False):
        axis.imshow(finished(scenario), interpolation="antialiased", interpolation_stage="rgba")
        axis.set_title(name, fontsize=13, fontweight="bold", pad=5)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    Image.open(path).convert("RGB").quantize(255, Image.Quantize.MEDIANCUT).save(path, optimize=True)


def finished(scenario: Scenario) -> NDArray[np.uint8]:
    """Return a picture of the finished assembly, as large as it fits; each part is one mesh, without inner faces."""
    assembly = scenario.assembly
    poses = {**scenario.start, **compute_placements(assembly, scenario.start, scenario.nominal_poses)[-1]}
    spec = mujoco.MjSpec.from_file(str(folder("assets") / "room.xml"))
    for part, solid in assembly.solids.items():
        add_part(spec, part, solid, scenario, poses[part])
    model = spec.compile()
    model.vis.headlight.ambient[:] = 0.4
    model.vis.global_.offwidth, model.vis.global_.offheight = SIZE
    corners = np.concatenate([corners_of(assembly.solids[part], poses[part]) for part in sorted(assembled(assembly))])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with renderer(model, *SIZE) as draws:
        draws.update_scene(data, camera=fit_camera(corners, AZIMUTH_DEG.get(scenario.name, 128.0), model))
        return np.array(draws.render())


def assembled(assembly: Assembly) -> set[str]:
    """Parts that touch another one than the table in the end; all but the table if none does."""
    last = {part: operation for operation in assembly.operations for part in (operation.main, *operation.carries)}
    touching: set[str] = set()
    for operation in last.values():
        pairs = [{contact.manipulated.part, contact.environment.part} for contact in operation.contacts]
        touching.update(*(pair for pair in pairs if "table" not in pair))
        touching.update((operation.main, *operation.carries) if operation.carries else ())
    return touching or set(assembly.solids) - {"table"}


def add_part(spec: Any, part: str, solid: Solid, scenario: Scenario, T: Array) -> None:
    """Add a part as a mesh without smoothed edges."""
    if part == "table":  # its pieces have faces in one plane
        shape = make_part_mesh(solid, scenario.clearance_mm).apply_scale(1e-3)
    else:
        shape = build_union_mesh(shrink_pieces(solid, 1e-3 * scenario.clearance_mm))
    mesh = spec.add_mesh(name=part, uservert=shape.triangles.ravel(), userface=np.arange(3 * len(shape.triangles)))
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    color = scenario.colors.get(part, TABLE if part == "table" else STEEL)
    body = spec.worldbody.add_body(pos=T[:3, 3], quat=Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True))
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=part, rgba=(*color, 1.0))


def corners_of(solid: Solid, T: Array) -> Array:
    """Corners of the pieces of a part, (n, 3), world, [m]."""
    own = np.concatenate([piece.corners for piece in solid.pieces])
    return np.asarray(own @ T[:3, :3].T + T[:3, 3])


def fit_camera(corners: Array, azimuth_deg: float, model: Any) -> Any:
    """Aim a camera so that points fill the picture."""
    az, el = np.radians((azimuth_deg, ELEVATION_DEG))
    ahead = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    right = np.cross(ahead, (0.0, 0.0, 1.0)) / np.cos(el)
    axes = np.stack([right, np.cross(right, ahead), ahead])
    seen = corners @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    half = np.tan(np.radians(model.vis.global_.fovy / 2)) * np.array([SIZE[0] / SIZE[1], 1.0])
    off = seen - middle
    distance = (np.abs(off[:, :2]) / (FILLED * half)).max(axis=1) - off[:, 2]
    return aim_camera(middle @ axes, float(distance.max()), azimuth_deg, ELEVATION_DEG)


if __name__ == "__main__":
    main()
