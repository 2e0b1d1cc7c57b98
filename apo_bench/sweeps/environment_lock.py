"""The environment lock of a sweep: what all its rows are made with, wherever they are made."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import final

from apo_bench.errors import InputError
from apo_bench.records.limits import CORRECTOR_LIMIT_S

PACKAGES = (
    *("apo_bench", "mujoco", "dm-control", "mink", "daqp", "gymnasium"),
    *("numpy", "scipy", "trimesh", "manifold3d", "shapely"),
)
"""Those whose version may show in a row."""


@final
@dataclass(frozen=True)
class EnvironmentLock:
    """Stated by the process that starts a sweep; a worker that finds anything else where it is refuses to work."""

    content: Mapping[str, str]
    """What was given for a scenario -> its `content_hash`."""
    versions: Mapping[str, str]
    """Package -> version, of `PACKAGES`."""
    corrector_limit_s: float = CORRECTOR_LIMIT_S
    """Wall time that a corrector in a process of its own may take."""

    def check_content(self, given: str, found: str) -> None:
        """Raise an `InputError` unless a scenario, and the code that runs it, are the same here."""
        if found != self.content[given]:
            raise InputError(
                f"a worker on '{platform.node()}' has other code or other files for '{given}' than the process that "
                "started the sweep; install the same everywhere, or start the same command again if a file was changed."
            )

    def check_versions(self) -> None:
        """Raise an `InputError` unless the packages are the same here."""
        here = versions()
        for package, version in self.versions.items():
            if here.get(package) != version:
                raise InputError(
                    f"a worker on '{platform.node()}' has {package} {here.get(package)}, the process that started the "
                    f"sweep {version}; install the same everywhere."
                )


def versions() -> dict[str, str]:
    """Package -> version, as installed here."""
    return {package: metadata.version(package) for package in PACKAGES}
