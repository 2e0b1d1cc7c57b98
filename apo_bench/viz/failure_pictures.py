"""Pictures of a sample of trials that failed: the parts where their records say that they ended."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Contact, Poses, list_outline_points
from apo_bench.benchmark.report.pictures import FailurePicture
from apo_bench.errors import InputError, require
from apo_bench.geometry import pose
from apo_bench.io import read_lines
from apo_bench.records import TrialConfig, TrialRecord, get_record_key, restore_settings
from apo_bench.records.run.replay_command import Files
from apo_bench.records.run.validation import record_of

_SIZE = (640, 480)
_QUALITY = 82
_AZIMUTH_DEG = 128.0
_ELEVATION_DEG = -24.0
_ARROW_M = 0.11  # how far from its contact an arrow begins
_TIP_M = 0.012  # and ends
_ARROW = (0.85, 0.1, 0.1)


def failure_pictures(
    chosen: Sequence[TrialRecord], folder: Path, files: Files
) -> tuple[list[FailurePicture], list[str]]:
    """Draw failed trials.

    Args:
        folder: Of the sweep, whose records say where parts ended.
        files: Scenario -> its file.

    Returns:
        The pictures that could be made, and sentences on those that could not.
    """
    pictures: list[FailurePicture] = []
    missed: list[str] = []
    for record in chosen:
        try:
            pictures.append(_draw_failure(record, folder, files))
        except (InputError, RuntimeError, OSError, ValueError) as error:
            missed.append(str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__)
            if "no picture can be drawn here" in missed[-1]:
                break
    return pictures, list(dict.fromkeys(missed))


def _draw_failure(record: TrialRecord, folder: Path, files: Files) -> FailurePicture:
    import imageio.v3 as iio

    from apo_bench.scenario.file import is_named
    from apo_bench.simulation.scene.render import draw_picture
    from apo_bench.trial.stages import scene_of

    name = record["scenario"]
    require(name in files or is_named(name), f"run.json names no file of the scenario '{name}'")
    # the arm is not in the picture, and may be code that the record names
    scene = scene_of(replace(restore_settings(record, files.get(name, name)), arm=TrialConfig.arm))
    poses = _read_poses(_whole_record(folder, record).get("reached"))
    require(poses, f"of seed {record['seed']} of {name} the record does not say where the parts ended")
    contact = _failed_contact(record, scene)
    image = draw_picture(scene, poses, *_SIZE, _camera(scene, record, poses), _mark(contact, scene, poses))
    words = "where the parts ended" if contact is None else f"where the parts ended; the arrow points at {contact}"
    return FailurePicture(record, iio.imwrite("<bytes>", image, extension=".jpg", quality=_QUALITY), words)


def _whole_record(folder: Path, record: TrialRecord) -> Mapping[str, Any]:
    """The record as it is in `trials.jsonl`, with what a report does not keep; empty if it is not found."""
    wanted = (f'"seed": {record["seed"]},'.encode(), json.dumps(record["config_hash"]).encode())
    path = folder / "trials.jsonl"
    for number, line in read_lines(path, "table of trials"):
        if all(part in line for part in wanted):
            whole = record_of(line, f"{path}, line {number}")
            if get_record_key(whole) == get_record_key(record):
                return whole
    return {}


def _failed_contact(record: TrialRecord, scene: Any) -> Contact | None:
    """The contact that the sentence of a failure names; else the first one of an operation that a force stopped."""
    operations = scene.scenario.assembly.operations
    sentence = f"{record.get('sentence') or ''} "
    k = record.get("failure_operation")
    # with a space behind it, so that `a.px on b.n` is not found in `a.px on b.nx`
    named = [contact for operation in operations for contact in operation.contacts if f"{contact} " in sentence]
    if k and record["failure_code"] == "force_stop":
        named += operations[k - 1].contacts
    return next(iter(named), None)


def _mark(contact: Contact | None, scene: Any, poses: Poses) -> Any:
    """An arrow from above to the middle of the face that makes the contact; of a fixed part, to the face upon it."""
    from apo_bench.simulation.scene.marks import Marks, ShiftArrows

    if contact is None or any(of.part not in poses for of in contact):
        return None
    assembly = scene.scenario.assembly
    of = contact.manipulated if contact.environment.part in assembly.fixed else contact.environment
    middle = list_outline_points(assembly, of, poses).mean(axis=0)
    return Marks([ShiftArrows(middle, np.array([0.0, 0.0, 1.0]), _ARROW_M, _TIP_M, _ARROW)])


def _read_poses(reached: Mapping[str, Sequence[float]] | None) -> Poses:
    """Part -> (4, 4), world frame, [m], from the mm of a record."""
    return {part: pose.unpack([*(np.array(x[:3]) * 1e-3), *x[3:]]) for part, x in (reached or {}).items()}


def _camera(scene: Any, record: TrialRecord, poses: Poses) -> Any:
    """A view of the parts of the operation that failed, else of all that were assembled."""
    from apo_bench.simulation.film.framing import frame_parts
    from apo_bench.simulation.scene.render import aim_camera

    assembly = scene.scenario.assembly
    k = record.get("failure_operation")
    failed = assembly.operations if k is None else assembly.operations[k - 1 : k]
    near = {part for o in failed for part in (*o.moves, *(contact.environment.part for contact in o.contacts))}
    shown = (near & poses.keys()) - assembly.fixed or poses.keys() - assembly.fixed
    return aim_camera(*frame_parts(assembly, [poses], shown), _AZIMUTH_DEG, _ELEVATION_DEG)
