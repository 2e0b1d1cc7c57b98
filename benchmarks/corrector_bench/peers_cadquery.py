"""CadQuery as a corrector of somebody's own: the mates of a CAD program, solved by IPOPT through CasADi.

What mates can say is where parts stand at the end: every contact that still stands becomes a `PointInPlane` and an
`Axis` constraint between two parts, begun at the poses that the seen goals leave them with; parts that no operation
moves are `Fixed`. CadQuery minimises the sum of all squared violations, lengths in units of the size of the assembly.

What they cannot say: contacts that were lost, earlier poses of a part, and how uncertain a pose is. So only an
operation that moved a part last, as its main part, gets a new goal; all others stay as they were seen. Nor does
anything hold the directions that the contacts leave free: CadQuery begins some degrees away from what it is given, and
ends degrees and sometimes decimetres away from it, even where every contact held already.

Needs `pip install cadquery`, which excludes the extra `cad`. CasADi and GTSAM hung now and then in one process, so this
refuses to start where GTSAM is loaded.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from apo_bench.assembly import Assembly, Correction, Observation, PartFace, Poses, Relation, largest_gap, placements
from apo_bench.correction.checks.status import as_it_ends
from apo_bench.errors import InputError
from apo_bench.geometry import Array, all_boxes
from apo_bench.records import outcomes

_MM = 1e3
"""CadQuery counts in mm."""
_PATCH_MM = 1.0
"""Side of the square that stands for a face; only its centre and its normal count."""


class _NoSolution(Exception):
    """CadQuery's solver gave up."""


def cadquery(observation: Observation) -> Correction:
    """The goals with which the parts end where CadQuery puts them.

    Returns:
        `converged` with the gap that is left in the sentence, of every contact ever made; `not_seen`; `not_converged`
        if the solver gave up, with what was seen.

    Raises:
        InputError: CadQuery is not installed or cannot be loaded beside GTSAM, or a contact or a part is not flat.
    """
    _check_flat(observation.assembly)
    module = _module()
    try:
        return as_it_ends(
            observation, lambda observation: _mated(module, observation), "the mates of the last poses were solved"
        )
    except _NoSolution:
        now = largest_gap(observation.assembly, observation.start, observation.poses)
        return Correction(observation.poses, "not_converged", outcomes.sentence("not_converged"), (), now, now, 0)


def _check_flat(assembly: Assembly) -> None:
    """Its mates are those of flat faces of boxes."""
    round_ = [r.contact for r in assembly.relations() if assembly.is_round(r.contact)]
    odd = [f"the contact {contact}" for contact in round_]
    odd += [f"the part '{name}'" for name, solid in assembly.solids.items() if not all_boxes(solid.pieces)]
    if odd:
        raise InputError(
            f"CadQuery knows flat contacts of parts made of boxes, and {odd[0]} is neither; use another corrector."
        )


def _module() -> Any:
    if "gtsam" in sys.modules:
        raise InputError(
            "CadQuery was asked for where GTSAM is loaded, and the two can hang in one process; "
            "run them in processes of their own."
        )
    try:
        import cadquery as module
    except ImportError as error:
        raise InputError(
            f"CadQuery was asked for, which cannot be imported ({error}); "
            "pip install cadquery, or use another corrector."
        ) from error
    return module


def _mated(cq: Any, observation: Observation) -> Array:
    """The seen goals (n, 4, 4), those of parts that were last moved as the main part replaced."""
    operations = observation.assembly.operations
    goals = np.array(observation.poses)
    standing = [relation for relation in observation.assembly.relations() if relation.lost is None]
    last = {part: k for k, operation in enumerate(operations) for part in operation.moves}
    if not any(end.part in last for relation in standing for end in relation.contact):
        return goals
    found = _solved(
        cq, observation, placements(observation.assembly, observation.start, goals)[-1], standing, set(last)
    )
    for part, T in found.items():
        if operations[last[part]].main == part:
            goals[last[part]] = T
    return goals


def _solved(cq: Any, observation: Observation, poses: Poses, standing: list[Relation], moved: set[str]) -> Poses:
    """Where the parts that were moved and touch something stand after the solve."""
    mated = {end.part: None for relation in standing for end in relation.contact}
    assembly = cq.Assembly(name="assembly")
    for part in mated:
        boxes = [_box(cq, box.center * _MM, box.half * _MM) for box in observation.assembly.solids[part].pieces]
        assembly.add(cq.Compound.makeCompound(boxes), name=part, loc=_location(cq, poses[part]))
        if part not in moved:
            assembly.constrain(part, "Fixed")
    for contact, _, _ in standing:
        ends = [(end.part, _patch(cq, observation, end)) for end in contact]
        for kind, param in (("PointInPlane", 0), ("Axis", 180)):
            assembly.constrain(*ends[0], *ends[1], kind, param)
    assembly.solve()
    if not assembly._solve_result["success"]:
        raise _NoSolution
    return {part: _pose(assembly.objects[part].loc) for part in mated if part in moved}


def _box(cq: Any, center: Array, half: Array) -> Any:
    return cq.Solid.makeBox(*(2 * half), cq.Vector(*(center - half)))


def _patch(cq: Any, observation: Observation, of: PartFace) -> Any:
    """A square at the middle of the corners of a face, looking the same way, in the frame of the part."""
    face = observation.assembly.face(of)
    center = face.outline.mean(axis=0) * _MM
    n = face.normal
    return cq.Face.makePlane(_PATCH_MM, _PATCH_MM, cq.Vector(*center), cq.Vector(*n))


def _location(cq: Any, T: Array) -> Any:
    return cq.Location(cq.Plane(tuple(T[:3, 3] * _MM), tuple(T[:3, 0]), tuple(T[:3, 2])))


def _pose(location: Any) -> Array:
    """Row by row, since angles and names of turns would lose digits; the rotation made orthogonal again."""
    moved = location.wrapped.Transformation()
    T = np.eye(4)
    T[:3] = [[moved.Value(i, j) for j in range(1, 5)] for i in range(1, 4)]
    T[:3, 3] /= _MM
    U, _, Vt = np.linalg.svd(T[:3, :3])
    T[:3, :3] = U @ Vt
    return T
