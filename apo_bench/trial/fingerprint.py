"""Hashes that identify a record: of the package version, all input files and the settings."""

import json
import shutil
import subprocess
from dataclasses import asdict
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from apo_bench import __version__
from apo_bench.formats.observation_json import OBSERVATION_SCHEMA
from apo_bench.formats.plan_json import PLAN_SCHEMA
from apo_bench.records import RECORD_SCHEMA, TrialConfig
from apo_bench.scenario import Scenario
from apo_bench.trial.input_files import compute_digest, hash_input_files, hash_noise_files, hash_user_code

_SCHEMAS = (RECORD_SCHEMA, OBSERVATION_SCHEMA, PLAN_SCHEMA)
_PACKAGES = (
    *("apo_bench", "mujoco", "mink", "daqp", "gymnasium"),
    *("numpy", "scipy", "trimesh", "manifold3d", "shapely"),
)
"""Packages whose version may change a record."""
_CHECKOUT = Path(__file__).parents[2]
"""Folder of the git checkout, if the package runs from one."""


def list_versions() -> dict[str, str]:
    """Package -> installed version; `none` for an optional package that is not installed."""
    return {package: metadata.version(package) if find_spec(package) else "none" for package in _PACKAGES}


def find_git_revision() -> str:
    """The git revision of the package, with `-dirty` if files differ from it; empty without a checkout."""
    git = shutil.which("git")
    if git is None or not (_CHECKOUT / ".git").exists():
        return ""
    # --exclude=*: the revision, never the name of a tag
    command = [git, "-C", str(_CHECKOUT), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def compute_content_hash(scenario: Scenario, source: str | Path | Scenario, arm_files: Path | tuple[Path, ...]) -> str:
    """16 hexadecimal digits over the files of a trial, the version of the package and its schemas.

    Args:
        source: The scenario as given to `load_scenario`.
        arm_files: `Arm.files`.
    """
    content = [hash_input_files(scenario, source, arm_files), __version__, _SCHEMAS]
    return compute_digest(json.dumps(content, sort_keys=True).encode())


def compute_config_hash(config: TrialConfig, content: str, observation: str = "") -> str:
    """16 hexadecimal digits over the content and every setting except method, seed and the path of the scenario.

    Records with equal hashes differ in method and seed alone, so they may be pooled or paired. Noise models from files
    and plugins (noise, contact source, arm) count by the content of their files, a secret seed by its hash.

    Args:
        content: From `compute_content_hash`.
        observation: Text of the observation file; empty if the observation is drawn.
    """
    settings = {k: v for k, v in asdict(config).items() if k not in ("method", "seed", "scenario", "secret_seed")}
    if config.secret_seed is not None:
        settings["secret_seed"] = config.secret_seed.hash
    own = {
        **hash_noise_files(config.noise),
        **hash_user_code("contact_source", config.contact_source),
        **hash_user_code("arm", config.arm),
    }
    return compute_digest(json.dumps([content, settings, observation, *own.values()], sort_keys=True).encode())
