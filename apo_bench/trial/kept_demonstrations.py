"""Demonstrations kept in a folder: what was simulated once is read again, bit for bit.

A file is JSON, and its name the hash of all that decides the demonstration. Whoever can read it knows the truth of its
trial, salted or not. The digest in it notices damage, not intent: whoever can write into the folder as this user
decides the truth of its trials.
"""

import hashlib
import json
import os
import platform
import sys
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import final

from apo_bench import __version__
from apo_bench.assembly.goals import Demonstration, Layout
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.pose import is_rigid
from apo_bench.io.documents import JsonNode, parse_json
from apo_bench.io.reading import read_text
from apo_bench.io.writing import write_whole
from apo_bench.records.settings import RANGE, TrialSettings
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.code_version import code_files
from apo_bench.trial.fingerprint import content_pieces
from apo_bench.trial.stages import SimulatedDemonstration, simulate_demonstration

SCHEMA = "apo-bench/kept-demonstration/1"
_KIND = "kept demonstration"
_LARGEST_BYTES = 1_000_000
_CODES = ("ok", "demonstration_failed")
_PACKAGES = ("dm-control", "mujoco", "numpy", "scipy", "shapely")
"""The packages that a demonstration is made with."""
_NOT_SHOWN = (
    *("correction/", "depth_camera/", "files/", "observation/", "prediction/", "recognition/", "sweeps/"),
    *("simulation/execution/", "simulation/sensor/", "simulation/settling.py", "trial/"),
)
_SHOWN = ("trial/kept_demonstrations.py", "trial/stages.py")


@final
class KeptDemonstrations:
    """A folder of demonstrations; several processes may use it at once."""

    def __init__(self, folder: str | Path) -> None:
        """Make the folder if it is not there.

        Raises:
            InputError: It is no folder, cannot be made, or cannot be written.
        """
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise InputError(
                f"the cache '{folder}' cannot be made ({why}); name a folder that can be written."
            ) from error
        if not os.access(self.folder, os.R_OK | os.W_OK | os.X_OK):
            raise InputError(f"the cache '{folder}' cannot be written; name a folder that can be.")

    def simulated(self, settings: TrialSettings, scene: Scene) -> SimulatedDemonstration:
        """The demonstration of a trial: read, or made and kept.

        What a range finder records of one is too large to be kept, so it is made again.

        Args:
            scene: As compiled for these settings.
        """
        if settings.eye == RANGE:
            return _made(settings, scene)
        key = demonstration_key(settings, scene)
        path = self.folder / f"{key}.json"
        said = ""
        if os.path.lexists(path):
            try:
                return _read(path, key, scene)
            except InputError as error:
                said = f"{str(error).rstrip('.')}; the demonstration is made again"
        made = _made(settings, scene)
        try:
            write_whole(path, _written(key, made))
        except OSError as error:
            why = error.strerror or error
            said = (
                f"{said}, and cannot be kept ({why})" if said else f"{path}: the demonstration cannot be kept ({why})"
            )
        if said:
            _say(f"{said}.")
        return made


def demonstration_key(settings: TrialSettings, scene: Scene) -> str:
    """64 hexadecimal digits over all that decides a demonstration: code, packages, processor, scenario, settings."""
    pieces = content_pieces(scene.scenario, settings.scenario, scene.arm.files)
    salt = None if settings.salt is None else settings.salt.hash
    chosen = [scene.clearance_mm, scene.physics.timestep_s, settings.careless, settings.seed, salt]
    del pieces["arm"]
    return _hash(json.dumps([_made_with(), sorted(pieces.items()), chosen]))


def decides(path: str) -> bool:
    """Whether a source file of the package can change a demonstration."""
    return path in _SHOWN or not path.startswith(_NOT_SHOWN)


@cache
def _made_with() -> str:
    """A hash over what is the same for all demonstrations of this process."""
    code = {path: hashed for path, hashed in code_files().items() if decides(path)}
    versions = [metadata.version(package) for package in _PACKAGES]
    return _hash(json.dumps([SCHEMA, __version__, code, versions, platform.machine(), platform.processor()]))


def _made(settings: TrialSettings, scene: Scene) -> SimulatedDemonstration:
    return simulate_demonstration(scene, settings.careless, settings.seed, settings.eye, settings.salt)


def _written(key: str, made: SimulatedDemonstration) -> str:
    human = made.demonstration
    layout = made.layout
    said = {
        "truth": layout.goals.tolist(),
        "start": {part: T.tolist() for part, T in layout.start.items()},
        "goals": human.goals.tolist(),
        "final": {part: T.tolist() for part, T in human.final.items()},
        "careless": human.careless.tolist(),
        "code": human.code,
        "why": human.why,
    }
    return json.dumps({"schema": SCHEMA, "key": key, "digest": _hash(json.dumps(said)), "demonstration": said})


def _read(path: Path, key: str, scene: Scene) -> SimulatedDemonstration:
    """What stands in a file.

    Raises:
        InputError: It is another user's, damaged, or of something else.
    """
    root = parse_json(read_text(path, _KIND, _LARGEST_BYTES, own=True), str(path)).fields(
        ("schema", "key", "digest", "demonstration")
    )
    digest = _hash(json.dumps(root["demonstration"].value))
    for name, wanted, why in (
        ("schema", SCHEMA, f"this is no {_KIND} of this version"),
        ("key", key, "this is another demonstration, renamed"),
        ("digest", digest, "the file is damaged"),
    ):
        if root[name].text() != wanted:
            raise InputError(f"{path}: {why}.")
    said = root["demonstration"].fields(("truth", "start", "goals", "final", "careless", "code", "why"))
    if said["code"].text() not in _CODES:
        said["code"].fail(f"{' or '.join(_CODES)} is needed")
    assembly = scene.scenario.assembly
    n = len(scene.scenario.assembly)
    layout = Layout(_poses(said["truth"], n), _named(said["start"], scene))
    human = Demonstration(
        assembly=assembly,
        start=layout.start,
        goals=_poses(said["goals"], n),
        final=_named(said["final"], scene),
        careless=said["careless"].numbers(n, 6, 6),
        code=said["code"].text(),
        why=said["why"].text(),
        gap_m=1e-3 * scene.scenario.gap_mm,
        play_m=1e-3 * scene.clearance_mm,
    )
    return SimulatedDemonstration(layout, human)


def _named(node: JsonNode, scene: Scene) -> dict[str, Array]:
    """Part -> its pose, (4, 4), of every part of the scenario."""
    return {part: _poses(of) for part, of in node.fields(scene.pieces).items()}


def _poses(node: JsonNode, *n: int) -> Array:
    found = node.numbers(*n, 4, 4)
    if not is_rigid(found.reshape(-1, 4, 4)).all():
        node.fail("poses are needed")
    return found


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _say(sentence: str) -> None:
    with suppress(OSError, AttributeError):
        sys.stderr.write(f"apo-bench: {sentence}\n")
