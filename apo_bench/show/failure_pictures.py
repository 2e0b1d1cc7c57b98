"""Pictures of a sample of trials that failed, made by running them again.

A trial is run again only where specification, assets and code are those of its row, by its hash; else the parts are
drawn where the row says that they ended. So are those of a salted trial whose salt was not given.
"""

import json
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Contact, Poses, outline_points
from apo_bench.errors import InputError, require
from apo_bench.geometry import pose, world_bounds
from apo_bench.io import each_line
from apo_bench.records import Row, Salt, TrialSettings, row_key, settings_of
from apo_bench.records.run.replay_command import Files, left_out, own_code
from apo_bench.records.run.validation import row_of
from apo_bench.report.pictures import FailurePicture
from apo_bench.show.axes import axis_marks

_WIDTH = 640
_HEIGHT = 480
_QUALITY = 82
_NEAREST_M = 0.12
_AZIMUTH_DEG = 128.0
_ELEVATION_DEG = -24.0
_ARROW_M = 0.11
_TIP_M = 0.012
_ARROW = (0.85, 0.1, 0.1)
"""How far from a contact its arrow begins and ends, and its colour."""
_SAME = ("success", "failure_stage", "failure_code", "failure_operation", "sentence", "worst_gap_mm", "peak_force_n")
"""A trial that was run again is the same if these are."""


def failure_pictures(
    chosen: Sequence[Row],
    folder: Path,
    files: Files | None = None,
    salt: Salt | None = None,
    *,
    trust_code: bool = False,
) -> tuple[list[FailurePicture], list[str]]:
    """The pictures that could be made, and sentences on what could not.

    Args:
        folder: Of the sweep, whose rows say where parts ended.
        salt: The one that the trials were drawn with, if any.
        trust_code: Import code of somebody's own that rows name; else none of it is.
    """
    pictures: list[FailurePicture] = []
    missed: list[str] = []
    scenes: dict[tuple[Any, ...], Any] = {}
    for row in chosen:
        if not trust_code and own_code(row):
            missed.append(left_out([row]))
            continue
        try:
            pictures.append(_picture_of(row, folder, files or {}, scenes, salt))
        except (InputError, RuntimeError, OSError, ValueError) as error:
            missed.append(str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__)
            if "no picture can be drawn here" in missed[-1]:
                break
    return pictures, list(dict.fromkeys(missed))


def _picture_of(
    row: Row, folder: Path, files: Files, scenes: dict[tuple[Any, ...], Any], salt: Salt | None
) -> FailurePicture:
    import imageio.v3 as iio

    from apo_bench.scenario.file import is_named
    from apo_bench.simulation.scene.render import picture
    from apo_bench.trial.fingerprint import content_hash, spec_hash
    from apo_bench.trial.stages import scene_key, scene_of

    require(
        row["scenario"] in files or is_named(row["scenario"]),
        f"run.json says no file of the scenario '{row['scenario']}'",
    )
    spec = replace(settings_of(row, files.get(row["scenario"], row["scenario"])), salt=salt)
    key = scene_key(spec)
    if key not in scenes:
        scenes[key] = scene_of(spec)
    scene = scenes[key]
    picture(scene, {}, 16, 12)  # is there anything to draw with? asked before the trial is run
    content = content_hash(scene.scenario, spec.scenario, scene.arm.files)
    how = "how the replay ended, run again for this picture"
    image = _again(row, spec, scene, content) if spec_hash(spec, content) == row.get("spec_hash") else None
    if image is None:
        poses = _poses(_whole_row(folder, row).get("reached"))
        if not poses:
            raise ValueError(f"of seed {row['seed']} of {row['scenario']} nothing is known of where the parts ended")
        image = picture(scene, poses, _WIDTH, _HEIGHT, _camera(scene, row, poses), _mark(row, scene, poses))
        secret = row.get("salt") is not None and salt is None
        why = "the file of its salt was not given (--salt-file)" if secret else "other code or assets made it"
        how = f"where the parts ended, as the row says; {why}, so it was not run again"
    contact = _failed_contact(row, scene)
    at = "" if contact is None else f"; the arrow points at {contact}"
    return FailurePicture(row, iio.imwrite("<bytes>", image, extension=".jpg", quality=_QUALITY), f"{how}{at}")


def _whole_row(folder: Path, row: Row) -> Mapping[str, Any]:
    """The row as it stands in `trials.jsonl`, with what a report does not keep; empty if it is not found."""
    wanted = (f'"seed": {row["seed"]},'.encode(), json.dumps(row["spec_hash"]).encode())
    path = folder / "trials.jsonl"
    for number, line in each_line(path, "table of trials"):
        if all(part in line for part in wanted):
            whole = row_of(line, f"{path}, line {number}")
            if row_key(whole) == row_key(row):
                return whole
    return {}


def _again(row: Row, spec: TrialSettings, scene: Any, content: str) -> Any:
    """The last moment of the replay, with the arm; None if it ended in another way."""
    from apo_bench.simulation.scene.render import picture_with_arm
    from apo_bench.trial.trial import run_trial

    last: deque[Any] = deque(maxlen=1)
    again = run_trial(spec, scene, content=content, watch=lambda data: last.append(np.array(data.qpos)))
    if not last or any(again.get(name) != row.get(name) for name in _SAME):
        return None
    poses = _poses(again["reached"])
    camera = _camera(scene, row, poses)
    fixed = {part: poses[part] for part in scene.scenario.assembly.fixed if part in poses}
    return picture_with_arm(scene, fixed, last[0], _WIDTH, _HEIGHT, camera, _mark(row, scene, poses))


def _failed_contact(row: Row, scene: Any) -> Contact | None:
    """The contact that the sentence of a failure names; else the first one of an operation that was stopped."""
    operations = scene.scenario.assembly.operations
    k = row.get("failure_operation")
    every = [contact for operation in operations for contact in operation.contacts]
    # with a space behind it, so that `a.px on b.n` is not found in `a.px on b.nx`
    named = [contact for contact in every if f"{contact} " in f"{row.get('sentence') or ''} "]
    return next(iter(named or (operations[k - 1].contacts if k and row["failure_code"] == "force_stop" else ())), None)


def _mark(row: Row, scene: Any, poses: Poses) -> Any:
    """An arrow from above to the middle of the face that the contact is made with; where that is the ground, to the
    face that should lie on it."""
    from apo_bench.simulation.scene.marks import Marks, ShiftArrows

    contact = _failed_contact(row, scene)
    assembly = scene.scenario.assembly
    of = contact and (contact.manipulated if contact.environment.part in assembly.fixed else contact.environment)
    if contact is None or of is None or of.part not in poses:
        return None
    middle = outline_points(assembly, of, poses).mean(axis=0)
    lines = axis_marks(assembly, [contact], poses) if all(each.part in poses for each in contact) else []
    return Marks([ShiftArrows(middle, np.array([0.0, 0.0, 1.0]), _ARROW_M, _TIP_M, _ARROW), *lines])


def _poses(reached: Mapping[str, Sequence[float]] | None) -> Poses:
    """Part -> (4, 4), world frame, [m], of what a row says in mm."""
    return {part: pose.unpack([*(np.array(x[:3]) * 1e-3), *x[3:]]) for part, x in (reached or {}).items()}


def _camera(scene: Any, row: Row, poses: Poses) -> Any:
    """One that sees what failed: the parts of the operation, else all that were assembled."""
    from apo_bench.simulation.scene.render import camera_view

    assembly = scene.scenario.assembly
    k = row.get("failure_operation")
    failed = assembly.operations if k is None else assembly.operations[k - 1 : k]
    near = {part for o in failed for part in (*o.moves, *(c.environment.part for c in o.contacts))}
    parts = [part for part in sorted(near) if part in poses and part not in assembly.fixed]
    if not parts:
        return camera_view(np.array([*scene.scenario.site.center_m, 0.06]), 0.6, _AZIMUTH_DEG, _ELEVATION_DEG)
    low, high = world_bounds((assembly.solids[part], poses[part]) for part in parts)
    far = _NEAREST_M + float(np.linalg.norm(high - low))
    return camera_view((low + high) / 2, min(far, 1.2), _AZIMUTH_DEG, _ELEVATION_DEG)
