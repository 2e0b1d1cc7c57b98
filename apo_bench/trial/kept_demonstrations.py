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

import numpy as np

from apo_bench import __version__
from apo_bench.assembly import Demonstration, Layout
from apo_bench.errors import InputError, require
from apo_bench.io import parse_json, read_text, write_file
from apo_bench.records import RANGE, TrialSettings
from apo_bench.simulation.scene import Scene
from apo_bench.trial.fingerprint import code_files
from apo_bench.trial.inputs import ARM, WEIGHTS, content_pieces
from apo_bench.trial.stages import SimulatedDemonstration, simulate_demonstration

SCHEMA = "apo-bench/kept-demonstration/1"
_KIND = "kept demonstration"
_LARGEST_BYTES = 1_000_000
_PACKAGES = ("mujoco", "numpy", "scipy", "shapely")
"""The packages that a demonstration is made with."""
_NOT_SHOWN = (
    *("correction/", "depth_camera/", "files/", "observation/", "prediction/", "recognition/", "sweeps/"),
    *("simulation/execution/", "simulation/sensor/", "simulation/scene/settling.py", "trial/"),
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
        require(
            os.access(self.folder, os.R_OK | os.W_OK | os.X_OK),
            f"the cache '{folder}' cannot be written; name a folder that can be.",
        )

    def simulated(self, settings: TrialSettings, scene: Scene) -> SimulatedDemonstration:
        """The demonstration of a trial: read, or simulated and kept.

        What a range finder records of one is too large to be kept, so it is simulated again.

        Args:
            scene: As compiled for these settings.
        """
        if settings.eye == RANGE:
            return demonstration_of(settings, scene)
        key = demonstration_key(settings, scene)
        path = self.folder / f"{key}.json"
        complaint = ""
        if os.path.lexists(path):
            try:
                return _read(path, key, scene)
            except InputError as error:
                complaint = f"{str(error).rstrip('.')}; the demonstration is made again"
        simulated = demonstration_of(settings, scene)
        try:
            write_file(path, _written(key, simulated), private=True)
        except InputError as error:
            what = f"{complaint}, and" if complaint else f"{path}: the demonstration"
            complaint = f"{what} cannot be kept: {str(error).rstrip('.')}"
        if complaint:
            with suppress(OSError, AttributeError):
                sys.stderr.write(f"apo-bench: {complaint}.\n")
        return simulated


def demonstration_of(
    settings: TrialSettings, scene: Scene, kept: KeptDemonstrations | None = None
) -> SimulatedDemonstration:
    """The demonstration of a trial, from the folder where they are kept if there is one."""
    if kept is not None:
        return kept.simulated(settings, scene)
    return simulate_demonstration(scene, settings.careless, settings.seed, settings.eye, settings.salt)


def demonstration_key(settings: TrialSettings, scene: Scene) -> str:
    """64 hexadecimal digits over all that decides a demonstration: code, packages, processor, scenario, settings."""
    pieces = content_pieces(scene.scenario, settings.scenario, scene.arm.files)
    salt = None if settings.salt is None else settings.salt.hash
    deciding = [scene.clearance_mm, scene.physics.timestep_s, settings.careless, settings.seed, salt]
    shown = sorted((name, found) for name, found in pieces.items() if name not in (ARM, WEIGHTS))
    return _hash(json.dumps([_made_with(), shown, deciding]))


def decides(path: str) -> bool:
    """Whether a source file of the package can change a demonstration."""
    return path in _SHOWN or not path.startswith(_NOT_SHOWN)


@cache
def _made_with() -> str:
    """A hash over what is the same for all demonstrations of this process."""
    code = {path: hashed for path, hashed in code_files().items() if decides(path)}
    versions = [metadata.version(package) for package in _PACKAGES]
    return _hash(json.dumps([SCHEMA, __version__, code, versions, platform.machine(), platform.processor()]))


def _written(key: str, simulated: SimulatedDemonstration) -> str:
    human = simulated.demonstration
    content = {
        "truth": simulated.layout.goals.tolist(),
        "start": {part: T.tolist() for part, T in simulated.layout.start.items()},
        "goals": human.goals.tolist(),
        "final": {part: T.tolist() for part, T in human.final.items()},
        "careless": human.careless.tolist(),
        "code": human.code,
        "why": human.why,
    }
    return json.dumps({"schema": SCHEMA, "key": key, "digest": _hash(json.dumps(content)), "demonstration": content})


def _read(path: Path, key: str, scene: Scene) -> SimulatedDemonstration:
    """What stands in a file; where its digest fits, it is what `_written` wrote.

    Raises:
        InputError: It is another user's, damaged, or of something else.
    """
    root = parse_json(read_text(path, _KIND, _LARGEST_BYTES, own=True), str(path)).fields(
        ("schema", "key", "digest", "demonstration")
    )
    content = root["demonstration"].value
    for name, wanted, why in (
        ("schema", SCHEMA, f"this is no {_KIND} of this version"),
        ("key", key, "this is another demonstration, renamed"),
        ("digest", _hash(json.dumps(content)), "the file is damaged"),
    ):
        require(root[name].text() == wanted, f"{path}: {why}.")
    start, final = ({part: np.array(T) for part, T in content[name].items()} for name in ("start", "final"))
    layout = Layout(np.array(content["truth"]), start)
    human = Demonstration(
        assembly=scene.scenario.assembly,
        start=layout.start,
        goals=np.array(content["goals"]),
        final=final,
        careless=np.array(content["careless"]),
        code=content["code"],
        why=content["why"],
        gap_m=1e-3 * scene.scenario.gap_mm,
        play_m=1e-3 * scene.clearance_mm,
    )
    return SimulatedDemonstration(layout, human)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
