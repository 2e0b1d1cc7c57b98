"""The command `apo-bench doctor`: check packages, extras and rendering."""

import platform
import re
from importlib.metadata import PackageNotFoundError, requires, version

import typer

from apo_bench import __version__
from apo_bench.cli.shared import NO_RESULT, print_columns
from apo_bench.errors import InputError
from apo_bench.io import group_by

_DEVELOPER_EXTRAS = ("dev", "docs", "notebook")
"""Extras that no command needs."""


def doctor_command() -> None:
    """Check the installation: packages, extras, rendering, window.

    Examples:
      apo-bench doctor
      MUJOCO_GL=egl apo-bench doctor
    """
    from apo_bench import build_scene, draw_picture, load_scenario
    from apo_bench.simulation.film.window import no_window

    lines = [("apo_bench", f"{__version__}, Python {platform.python_version()}, {platform.platform()}")]
    for extra, packages in _read_extras().items():
        found = [f"{name} {_find_version(name)}" for name in packages if _find_version(name)]
        missing = [name for name in packages if not _find_version(name)]
        advice = f'missing: {", ".join(missing)}; install with: pip install "apo_bench[{extra}]"'
        lines.append((f"extra {extra}" if extra else "packages", ", ".join(found + [advice] * bool(extra and missing))))
    drawing = "works"
    try:
        draw_picture(build_scene(load_scenario("block_on_block")), {}, 16, 12)
    except InputError as error:
        drawing = str(error)
    print_columns([*lines, ("rendering", drawing), ("window", no_window() or "works")])
    if drawing != "works":
        raise typer.Exit(NO_RESULT)


def _read_extras() -> dict[str, list[str]]:
    """Extra -> packages that it installs; those of the plain package under the empty name."""
    pairs = []
    for requirement in requires("apo_bench") or ():
        extra = re.search(r"extra == ['\"](\w+)", requirement)
        name = re.match(r"[\w.-]+", requirement)
        pairs.append((extra.group(1) if extra else "", name.group() if name else requirement))
    return {
        extra: [*dict.fromkeys(names)] for extra, names in group_by(pairs).items() if extra not in _DEVELOPER_EXTRAS
    }


def _find_version(package: str) -> str:
    """The version of an installed package, or nothing."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
