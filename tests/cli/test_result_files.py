"""Files that commands write: there though nobody reads what is printed, whole or not at all, never through a link."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import trimesh

from tests import bop_made
from tests.benchmark.analysis.test_rates import row, write
from tests.benchmark.scoring.test_entry import entry, track

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files as Linux does")
ROOT = Path(__file__).parent.parent.parent
LOG = f"{ROOT}/docs/recording.csv --format csv --camera camera.toml"
COMMANDS = {
    "inspect graph stick_in_tower --out graph.svg": "graph.svg",
    f"inspect plan stick_in_tower --observation {ROOT}/docs/seen.csv --robot-plan robot.json": "robot.json",
    "arm check six_axis block_on_block --layouts 1 --out arm.png": "arm.png",
    "noise fit --estimates estimates.csv --truth truth.csv --out fit.toml --residuals fit.csv --picture fit.png": (
        "fit.toml fit.csv fit.png"
    ),
    f"recording import {LOG} --objects objects.toml --scenario stick_in_tower --out seen.json --picture seen.png "
    "--paths-out seen_paths.csv": "seen.json seen.png seen_paths.csv",
    f"correct stick_in_tower --observation {ROOT}/docs/seen.csv --out plan.csv": "plan.csv",
    "run block_on_block --save-observation saved.json --video film.gif --fidelity near-contact": "saved.json film.gif",
    "part import pin.stl --unit mm --out parts": "parts/pin.xml parts/pin.toml parts/pin.png",
    "scenario new block --poses poses.toml --fixed lower --out pile.toml --overwrite": "pile.toml",
    "leaderboard entries --out page.md": "page.md page.png",
    "report rows --max-pictures 0": (
        "rows/report.html rows/tables/records.parquet rows/tables/conditions.csv "
        "rows/tables/conditions.parquet rows/figures/success_over_noise_level.svg"
    ),
    "compare rows rows --out compared": "compared/compare.html compared/agreement.csv compared/agreement.parquet",
}
"""Command -> the files that it writes."""
PROGRAM = """
import contextlib, io, json, os, resource, sys
from pathlib import Path
from apo_bench.cli.app import main

def hidden():
    return [str(path) for path in Path().rglob("*.part")]

def run(command):
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        sys.stdout = sys.__stdout__
        code = main(command.split())
    return code, said.getvalue()

done = {}
for command, names in json.loads(Path("commands.json").read_text()).items():
    files = [Path(name) for name in names.split()]
    done[command] = each = {"closed pipe": run(command), "written": [path.is_file() for path in files]}
    kept = {path: path.read_bytes() for path in files if path.is_file()}
    for path in kept:
        path.write_text("old")
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, resource.RLIM_INFINITY))
    each["no room"] = run(command)
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    each["kept"] = [path.read_text() == "old" for path in kept if len(kept[path]) > 200]
    each["hidden"] = hidden()
    for path in kept:
        path.write_bytes(kept[path])
    each["links"] = []
    for path in list(kept)[:1]:  # the others are replaced by the same function
        victim = Path("victim")
        victim.write_text("mine")
        path.unlink()
        path.symlink_to(victim.resolve())
        each["links"].append([*run(command), victim.read_text(), path.is_symlink()])
        path.unlink()
        path.write_bytes(kept[path])
    Path("done.json").write_text(json.dumps(done))
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What became of every command: with closed standard output, with no room for its files, with links in its way."""
    folder = tmp_path_factory.mktemp("commands")
    bop_made.files(folder, bop_made.draw(300, bop_made.Known(), np.random.default_rng(2)))
    known = '[known]\ncastle1 = "start"\ncastle2 = "start"\nstick = "start"\n'
    (folder / "camera.toml").write_text(f'schema = "apo-bench/camera/1"\n{known}')
    ids = 'castle1 = { id = "11" }\ncastle2 = { id = "12" }\n'
    ids += 'stick = { id = "13", frame = { at_mm = [0, 0, -10], turn_deg = [0, 0, 90] } }\n'
    (folder / "objects.toml").write_text(f'schema = "apo-bench/objects/1"\n[objects]\n{ids}')
    (folder / "poses.toml").write_text(
        '[[pose]]\npart = "block"\nname = "upper"\nat_mm = [300, 100, 85]\n'
        '[[pose]]\npart = "block"\nname = "lower"\nat_mm = [300, 100, 35]\n'
    )
    trimesh.creation.cylinder(8.0, 40.0, sections=48).export(folder / "pin.stl")
    (folder / "entries").mkdir()
    (folder / "entries" / "one.json").write_bytes(msgspec.json.encode(entry("one", given=track(a="10"))))
    write(folder / "rows", [row("contact", k, k < 2) for k in range(3)])
    (folder / "commands.json").write_text(json.dumps(COMMANDS))
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = subprocess.run(
            [sys.executable, "-c", PROGRAM], cwd=folder, stdout=writing, stderr=subprocess.PIPE, check=False
        )
    finally:
        os.close(writing)
    assert ended.returncode == 0, ended.stderr.decode()
    made: dict[str, dict[str, Any]] = json.loads((folder / "done.json").read_text())
    return made


def test_results_are_there_though_nobody_reads_what_is_printed(done: dict[str, dict[str, Any]]) -> None:
    assert done.keys() == COMMANDS.keys()
    for command, each in done.items():
        assert each["closed pipe"][0] == 0, (command, each["closed pipe"])
        assert "Traceback" not in each["closed pipe"][1]
        assert all(each["written"]), command


def test_a_file_that_cannot_be_written_again_is_the_old_one(done: dict[str, dict[str, Any]]) -> None:
    for command, each in done.items():
        code, said = each["no room"]
        assert code == 2, command
        assert said.count("\n") == 1, (command, said)
        assert "cannot be written (File too large)" in said
        assert any(name in said for name in COMMANDS[command].split()), (command, said)
        assert each["kept"], command
        assert all(each["kept"]), command
        assert each["hidden"] == [], command


def test_no_command_writes_through_a_link(done: dict[str, dict[str, Any]]) -> None:
    for command, each in done.items():
        ((code, said, victim, is_link),) = each["links"]
        assert (code, victim, is_link) == (2, "mine", True), (command, said)
        assert "is a symbolic link" in said
