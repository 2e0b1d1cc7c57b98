"""Ways for parts with play to collide: `python -m benchmarks.colliding [WORD ...]`.

Pairs (`colliding_pairs.py`) collide as the pieces that they are cut into, as those of CoACD (where `coacd` is
installed), as signed distances, and as MuJoCo's own hulls of the meshes. Said of each way: how deep contacts are where
the parts overlap by nothing, where the one comes to rest that falls 3 mm into its place, free to shift, and the time of
the processor that a step takes. Of pieces also how far they stick out of the solid as drawn, in parts of the play: at
points 0.3 mm apart on the surface of what is outside. The table is that of `docs/guide/part.md`. Some minutes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from manifold3d import Manifold

from apo_bench.cad.assembled import coming_near
from apo_bench.cad.importing import raw_solids
from apo_bench.cad.pieces.cutting import cut
from apo_bench.cad.solids.bodies import mesh_of
from apo_bench.geometry import Hull
from benchmarks.colliding_pairs import PAIRS, Pair
from tests.cad.made import write_stl

_FALL_MM = 3.0
_STEPS = 1000
_STEP_MM = 0.3
_NEAREST = 24
_THRESHOLDS = (0.05, 0.02)
_AXES = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
_SCENE = """<mujoco><option timestep="0.001" cone="elliptic"/><size memory="400M"/><asset>{}{}</asset>
<worldbody>{}<body>{}{}</body></worldbody></mujoco>"""


class Shape(NamedTuple):
    """How one part collides: what MuJoCo loads, and its geoms."""

    assets: str
    geoms: str
    pieces: int | None = None


def of_mesh(path: Path, kind: str) -> Shape:
    """A mesh as MuJoCo takes it: `sdf` its signed distance, `mesh` its hull."""
    name = path.stem
    return Shape(
        f'<mesh name="{name}" file="{path}" scale="0.001 0.001 0.001"/>', f'<geom type="{kind}" mesh="{name}"/>'
    )


def of_pieces(name: str, pieces: Sequence[Hull], bit: int) -> Shape:
    """Convex pieces; those of one part do not collide with each other."""
    assets, geoms = [], []
    mask = f'contype="{bit}" conaffinity="{3 - bit}"'
    for i, piece in enumerate(pieces):
        if (c := piece.cylinder) is not None:
            size = f'pos="{_text(c.center)}" zaxis="{_text(c.axis)}" size="{c.radius} {c.half_length}"'
            geoms.append(f'<geom type="cylinder" {size} {mask}/>')
        else:
            assets.append(f'<mesh name="{name}{i}" vertex="{_text(piece.corners.ravel())}" inertia="shell"/>')
            geoms.append(f'<geom type="mesh" mesh="{name}{i}" {mask}/>')
    return Shape("".join(assets), "".join(geoms), len(pieces))


def _text(numbers: Any) -> str:
    return " ".join(f"{x:.9g}" for x in numbers)


def tried(fixed: Shape, moving: Shape) -> str:
    """Cells of the table: depth at its place, where it comes to rest, time of a step."""
    model = mujoco.MjModel.from_xml_string(_SCENE.format(fixed.assets, moving.assets, fixed.geoms, _AXES, moving.geoms))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    deep = max((-1e3 * contact.dist for contact in data.contact), default=0.0)
    data.qpos[2] = 1e-3 * _FALL_MM
    start = time.process_time()
    for _ in range(_STEPS):
        mujoco.mj_step(model, data)
    step_us = 1e6 * (time.process_time() - start) / _STEPS
    off = 1e3 * float(data.qpos[2])
    rest = "at its place" if abs(off) < 0.05 else f"{abs(off):.2f} mm too {'high' if off > 0.0 else 'low'}"
    return f"{max(deep, 0.0):.3f} | {rest} | {step_us:.0f}"


def sticks_out(pieces: Sequence[Hull], drawn: Any) -> tuple[float, Any]:
    """How far pieces lie outside of a solid at most, and where, [mm]."""
    from scipy.spatial import cKDTree
    from trimesh.triangles import closest_point

    mesh = mesh_of(drawn.refine_to_length(3.0 * _STEP_MM))
    triangles = mesh.corners[mesh.triangles]
    tree = cKDTree(triangles.mean(axis=1))
    worst, where = 0.0, np.zeros(3)
    for piece in pieces:
        outside = Manifold.hull_points(1e3 * piece.corners) - drawn
        if outside.is_empty():
            continue
        points = mesh_of(outside.refine_to_length(_STEP_MM)).corners
        near = tree.query(points, k=_NEAREST)[1]
        every = np.repeat(points, _NEAREST, axis=0)
        off = np.linalg.norm(closest_point(triangles[near.ravel()], every) - every, axis=1).reshape(near.shape)
        k = int(off.min(axis=1).argmax())
        if off[k].min() > worst:
            worst, where = float(off[k].min()), points[k]
    return worst, where


def ways(name: str, pair: Pair, folder: Path) -> Iterator[str]:
    """Rows of the table."""
    files = [write_stl(each, folder / f"{part}.stl") for part, each in zip(("fixed", "moving"), pair[:2], strict=True)]
    raws = [raw_solids(file, "mm")[1][0] for file in files]
    start = time.process_time()
    fixed, moving = (cut(raw, near).pieces for raw, near in zip(raws, coming_near(raws), strict=True))
    seconds = time.process_time() - start
    shapes = [of_pieces("f", fixed, 1), of_pieces("m", moving, 2)]
    out = [sticks_out(pieces, drawn) for pieces, drawn in zip((fixed, moving), pair[:2], strict=True)]
    far, at = max(out, key=lambda each: each[0])
    print(f"{name}: pieces lie {far:.4f} mm outside at most, at {np.round(at, 1)}", flush=True)
    share = f"{far:.3f} mm, {far / pair.play:.0%} of {pair.play:g} mm"
    yield f"| {name} | own pieces | {len(fixed)} + {len(moving)} | {tried(*shapes)} | {seconds:.1f} | {share} |"
    for threshold in _THRESHOLDS:
        start = time.process_time()
        if (hulls := coacd(pair.fixed, threshold)) is not None:
            seconds = time.process_time() - start
            cells = tried(of_pieces("f", hulls, 1), shapes[1])
            far = sticks_out(hulls, pair.fixed)[0]
            yield f"| | CoACD, {threshold:g} | {len(hulls)} + {len(moving)} | {cells} | {seconds:.1f} | {far:.3f} mm |"
    for kind, way in (("sdf", "signed distances"), ("mesh", "hulls of the meshes")):
        yield f"| | {way} | - | {tried(*(of_mesh(file, kind) for file in files))} | - | - |"


def coacd(drawn: Any, threshold: float) -> list[Hull] | None:
    """Pieces of CoACD; None where it is not installed."""
    try:
        import coacd as decomposition
    except ImportError:
        return None
    decomposition.set_log_level("error")
    mesh = mesh_of(drawn)
    parts = decomposition.run_coacd(decomposition.Mesh(mesh.corners, mesh.triangles), threshold=threshold)
    return [Hull("", 1e-3 * np.asarray(corners)) for corners, _ in parts]


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("words", nargs="*", help="in the names of the pairs; default: all")
    given = asked.parse_args()
    rows = ["| parts | way | pieces | depth at its place, mm | comes to rest | us per step | s to cut | sticks out |"]
    rows.append("|---" * 8 + "|")
    for name, draw in PAIRS.items():
        if not given.words or any(word in name for word in given.words):
            with tempfile.TemporaryDirectory() as folder:
                rows += ways(name, draw(), Path(folder))
            print(rows[-1])
    print("\n".join(rows))
    if not any("CoACD" in row for row in rows):
        print("CoACD is not installed, so its rows are left out: pip install coacd.")


if __name__ == "__main__":
    main()
