"""The files behind the names of noise models."""

from collections.abc import Mapping
from pathlib import Path

from apo_bench.records import RESIDUALS
from apo_bench.resources import folder


def presets() -> Mapping[str, Path]:
    """The noise files that come with the package, by the names they go by."""
    return {path.stem: path for path in sorted(folder("assets").glob("noise/*.toml"))}


def noise_path(name: str) -> Path | None:
    """The file behind the name of a noise model, None if there is none.

    A path that ends in .toml, a name that comes with the package, or `empirical:` and the path of a file of residuals.
    """
    if name.startswith(RESIDUALS):
        return Path(name.removeprefix(RESIDUALS))
    if name.endswith(".toml"):
        return Path(name)
    return presets().get(name)
