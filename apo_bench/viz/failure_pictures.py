"""Pictures of a sample of trials that failed, made by running them again.

A trial is run again only where specification, assets and code are those of its row, by its hash; else the parts are
drawn where the row says that they ended. So are those of a salted trial whose salt was not given.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Contact, Poses, outline_points
from apo_bench.benchmark.report.pictures import FailurePicture
from apo_bench.errors import InputError, require
from apo_bench.geometry import pose
from apo_bench.io import each_line
from apo_bench.records import SecretSeed, TrialConfig, TrialRecord, record_key, settings_of
from apo_bench.records.own_code import describe_own_code, own_code
from apo_bench.records.run.replay_command import Files
from apo_bench.records.run.validation import record_of

_SIZE = (640, 480)
_QUALITY = 82
_AZIMUTH_DEG = 128.0
_ELEVATION_DEG = -24.0
_ARROW_M = 0.11  # how far from its contact an arrow begins
_TIP_M = 0.012  # and ends
_ARROW = (0.85, 0.1, 0.1)
_SAME = ("success", "failure_stage", "failure_code", "failure_operation", "sentence", "worst_gap_mm", "peak_force_n")
"""A trial that was run again is the same if these are."""


def failure_pictures(
    chosen: Sequence[TrialRecord],
    folder: Path,
    files: Files | None = None,
    secret_seed: SecretSeed | None = None,
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
    for row in chosen:
        if not trust_code and own_code(row):
            missed.append(describe_own_code([row]))
            continue
        try:
            pictures.append(_picture_of(row, folder, files or {}, secret_seed))
        except (InputError, RuntimeError, OSError, ValueError) as error:
            missed.append(str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__)
            if "no picture can be drawn here" in missed[-1]:
                break
    return pictures, list(dict.fromkeys(missed))


def _picture_of(row: TrialRecord, folder: Path, files: Files, secret_seed: SecretSeed | None) -> FailurePicture:
    import imageio.v3 as iio

    from apo_bench.scenario.file import is_named
    from apo_bench.simulation.scene.render import picture
    from apo_bench.trial.stages import scene_of
    from apo_bench.viz.again import why_not_again

    name = row["scenario"]
    require(name in files or is_named(name), f"run.json says no file of the scenario '{name}'")
    spec = replace(settings_of(row, files.get(name, name)), secret_seed=secret_seed)
    scene = scene_of(spec)
    picture(scene, {}, 16, 12)  # is there anything to draw with? asked before the trial is run
    changed = why_not_again(row, spec)
    how = "how the replay ended, run again for this picture"
    image = None if changed else _draw_again(row, spec)
    if image is None:
        poses = _poses(_whole_row(folder, row).get("reached"))
        require(bool(poses), f"of seed {row['seed']} of {name} nothing is known of where the parts ended")
        image = picture(scene, poses, *_SIZE, _camera(scene, row, poses), _mark(row, scene, poses))
        how = (
            f"where the parts ended, as the row says; {changed or 'now it ends in another way'}, so it is not run again"
        )
    contact = _failed_contact(row, scene)
    at = "" if contact is None else f"; the arrow points at {contact}"
    return FailurePicture(row, iio.imwrite("<bytes>", image, extension=".jpg", quality=_QUALITY), f"{how}{at}")


def _whole_row(folder: Path, row: TrialRecord) -> Mapping[str, Any]:
    """The row as it stands in `trials.jsonl`, with what a report does not keep; empty if it is not found."""
    wanted = (f'"seed": {row["seed"]},'.encode(), json.dumps(row["config_hash"]).encode())
    path = folder / "trials.jsonl"
    for number, line in each_line(path, "table of trials"):
        if all(part in line for part in wanted):
            whole = record_of(line, f"{path}, line {number}")
            if record_key(whole) == record_key(row):
                return whole
    return {}


def _draw_again(row: TrialRecord, spec: TrialConfig) -> Any:
    """The last moment of the replay, with the arm; None if it ended in another way."""
    from apo_bench.simulation.scene.render import picture_with_arm
    from apo_bench.viz.again import run_again

    now, rollout = run_again(spec)
    if rollout is None or any(now.get(name) != row.get(name) for name in _SAME):
        return None
    poses = _poses(now["reached"])
    last = rollout.segments[-1].moments[-1].qpos
    camera = _camera(rollout.scene, row, poses)
    return picture_with_arm(rollout.scene, poses, last, *_SIZE, camera, _mark(row, rollout.scene, poses))


def _failed_contact(row: TrialRecord, scene: Any) -> Contact | None:
    """The contact that the sentence of a failure names; else the first one of an operation that was stopped."""
    operations = scene.scenario.assembly.operations
    sentence = f"{row.get('sentence') or ''} "
    for contact in (contact for operation in operations for contact in operation.contacts):
        # with a space behind it, so that `a.px on b.n` is not found in `a.px on b.nx`
        if f"{contact} " in sentence:
            return contact
    k = row.get("failure_operation")
    if k and row["failure_code"] == "force_stop":
        return next(iter(operations[k - 1].contacts), None)
    return None


def _mark(row: TrialRecord, scene: Any, poses: Poses) -> Any:
    """An arrow from above to the middle of the face that the contact is made with; where that is the ground, to the
    face that should lie on it."""
    from apo_bench.simulation.scene.marks import Marks, ShiftArrows

    contact = _failed_contact(row, scene)
    assembly = scene.scenario.assembly
    if contact is None or any(of.part not in poses for of in contact):
        return None
    of = contact.manipulated if contact.environment.part in assembly.fixed else contact.environment
    middle = outline_points(assembly, of, poses).mean(axis=0)
    return Marks([ShiftArrows(middle, np.array([0.0, 0.0, 1.0]), _ARROW_M, _TIP_M, _ARROW)])


def _poses(reached: Mapping[str, Sequence[float]] | None) -> Poses:
    """Part -> (4, 4), world frame, [m], of what a row says in mm."""
    return {part: pose.unpack([*(np.array(x[:3]) * 1e-3), *x[3:]]) for part, x in (reached or {}).items()}


def _camera(scene: Any, row: TrialRecord, poses: Poses) -> Any:
    """One that sees the parts of the operation that failed, else all that were assembled."""
    from apo_bench.simulation.film.framing import frame_parts
    from apo_bench.simulation.scene.render import camera_view

    assembly = scene.scenario.assembly
    k = row.get("failure_operation")
    failed = assembly.operations if k is None else assembly.operations[k - 1 : k]
    near = {part for o in failed for part in (*o.moves, *(contact.environment.part for contact in o.contacts))}
    shown = (near & poses.keys()) - assembly.fixed or poses.keys() - assembly.fixed
    return camera_view(*frame_parts(assembly, [poses], shown), _AZIMUTH_DEG, _ELEVATION_DEG)
