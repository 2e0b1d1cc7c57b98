"""Pictures do not depend on a `matplotlibrc` in the folder in which somebody works."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

DRAW = """
import hashlib
from pathlib import Path
from apo_bench.assembly.graph import relation_graph
from apo_bench.benchmark.report.figures.sheet import Panel, draw
from apo_bench.scenario.file import load_scenario
from apo_bench.viz.graph.drawing import draw_graph

drawing = draw("rates", [Panel("one", lambda axis: axis.plot([0, 1], [0, 1]))], {})
draw_graph(relation_graph(load_scenario("block_on_block").assembly), Path("graph.svg"), title="graph")
written = (drawing.svg.encode(), drawing.write(Path("a.png")).read_bytes(), Path("graph.svg").read_bytes())
print(*(hashlib.sha256(each).hexdigest() for each in written))
"""
SETTINGS = b"""
figure.facecolor: red
savefig.facecolor: red
savefig.bbox: tight
lines.linewidth: 9
font.size: 40
text.usetex: True
svg.fonttype: none
backend: module://stolen
nonsense: 1
axes.grid
"""


def drawn(folder: Path) -> tuple[str, str]:
    """What is printed in a folder, and what is complained of."""
    program = [sys.executable, "-P", "-c", DRAW]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False, timeout=100)
    return done.stdout, done.stderr


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> str:

    said, complained = drawn(tmp_path_factory.mktemp("clean"))
    assert complained == ""
    assert len(said.split()) == 3
    return said


@pytest.mark.parametrize("content", [SETTINGS, None], ids=["settings", "a pipe"])
def test_a_file_of_settings_in_the_folder_changes_nothing(content: bytes | None, clean: str, tmp_path: Path) -> None:
    path = tmp_path / "matplotlibrc"
    if content is None:
        os.mkfifo(path)
    else:
        path.write_bytes(content)
    assert drawn(tmp_path) == (clean, "")


def test_the_settings_of_whoever_draws_come_back() -> None:
    import matplotlib

    from apo_bench.io.figures import default_looks

    with matplotlib.rc_context({"font.size": 33.0}):
        with default_looks({"lines.linewidth": 7.0}) as inside:
            assert inside.rcParams["font.size"] == 10.0
            assert inside.rcParams["lines.linewidth"] == 7.0
        assert matplotlib.rcParams["font.size"] == 33.0
