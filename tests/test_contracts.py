"""The walls of the house: every contract is kept, and each one breaks when its wall is broken."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import grimp
import pytest
from importlinter import configuration
from importlinter.contracts.forbidden import ForbiddenContract
from importlinter.contracts.layers import LayersContract

ROOT = Path(__file__).parent.parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
CONTRACTS: dict[str, dict[str, Any]] = {contract["id"]: contract for contract in SETTINGS["contracts"]}
configuration.configure()
KINDS = {"layers": LayersContract, "forbidden": ForbiddenContract}
BREACHES = {
    "layers": [
        ("apo_bench.correction.contact.contact", "apo_bench.simulation.scene.world"),
        ("apo_bench.simulation.scene.scene", "apo_bench.correction.contact.contact"),
        ("apo_bench.scenario.file", "apo_bench.trial.trial"),
        ("apo_bench.geometry.pose", "apo_bench.assembly.goals"),
        ("apo_bench.sweeps.sweep", "apo_bench.report.report"),
    ],
    "simulation": [
        ("apo_bench.simulation.arms.kinematics", "apo_bench.simulation.scene.world"),
        ("apo_bench.simulation.scene.scene", "apo_bench.simulation.robot.gripper"),
        ("apo_bench.simulation.robot.robot_error", "apo_bench.simulation.execution.transfer"),
        ("apo_bench.simulation.human.hands", "apo_bench.simulation.execution.fingers"),
        ("apo_bench.simulation.execution.controller", "apo_bench.simulation.film.track"),
        ("apo_bench.simulation.execution.prepare", "apo_bench.simulation.arm_checks.plan_check"),
        ("apo_bench.simulation.arm_checks.plan_check", "apo_bench.simulation.task.start"),
    ],
    "simulation-loose": [
        ("apo_bench.simulation.physics", "apo_bench.simulation.scene.world"),
        ("apo_bench.simulation.hooks", "apo_bench.simulation.robot.robot"),
    ],
    "cad": [
        ("apo_bench.cad.faces.fitting", "apo_bench.cad.step.surfaces"),
        ("apo_bench.cad.pieces.cutting", "apo_bench.cad.meshes.shells"),
        ("apo_bench.cad.solids.raw_solid", "apo_bench.cad.pieces.corners"),
    ],
    "cad-loose": [
        ("apo_bench.cad.pieces.cutting", "apo_bench.cad.contact_faces"),
        ("apo_bench.cad.solids.naming", "apo_bench.cad.part_report"),
    ],
    "correction": [
        ("apo_bench.correction.solvers.gauss_newton", "apo_bench.correction.contact.contact"),
        ("apo_bench.correction.solvers.posterior", "apo_bench.correction.checks.status"),
        ("apo_bench.correction.checks.status", "apo_bench.correction.contact.solved"),
        ("apo_bench.correction.baselines.paper", "apo_bench.correction.contact.problem"),
        ("apo_bench.correction.contact.starts", "apo_bench.correction.robust.views"),
        ("apo_bench.correction.robust.views", "apo_bench.correction.directions"),
    ],
    "contact": [
        ("apo_bench.correction.contact.problem", "apo_bench.correction.contact.solved"),
        ("apo_bench.correction.contact.inferred", "apo_bench.correction.contact.problem"),
        ("apo_bench.correction.contact.starts", "apo_bench.correction.contact.contact"),
    ],
    "touches": [
        ("apo_bench.correction.touches.robust_estimate", "apo_bench.correction.touches.belief"),
        ("apo_bench.correction.touches.robust_estimate", "apo_bench.correction.touches.belief"),
    ],
    "workshop": [
        ("apo_bench.trial.trial", "apo_bench.recording.importing"),
        ("apo_bench.show.card", "apo_bench.drafting.draft"),
        ("apo_bench.scenario.file", "apo_bench.cad.importing"),
    ],
    "report": [
        ("apo_bench.report.page.report_page", "apo_bench.report.comparison.text"),
        ("apo_bench.report.page.report_page", "apo_bench.report.answer"),
        ("apo_bench.report.tables.cells", "apo_bench.report.facts"),
        ("apo_bench.report.figures.figures", "apo_bench.report.page.report_page"),
    ],
    "statistics": [
        ("apo_bench.statistics.rates", "apo_bench.statistics.half_level"),
        ("apo_bench.statistics.settings", "apo_bench.statistics.summary"),
        ("apo_bench.statistics.paired", "apo_bench.statistics.over_seeds"),
    ],
    "sweeps": [
        ("apo_bench.sweeps.grid", "apo_bench.sweeps.worker"),
        ("apo_bench.sweeps.worker", "apo_bench.sweeps.pool"),
        ("apo_bench.sweeps.pool", "apo_bench.sweeps.cluster"),
        ("apo_bench.sweeps.cluster", "apo_bench.sweeps.sweep"),
    ],
    "judge": [
        ("apo_bench.judging.verdict", "apo_bench.observation.noise"),
        ("apo_bench.judging.contacts", "apo_bench.recognition.contacts"),
        ("apo_bench.judging.verdict", "apo_bench.correction.contact.contact"),
    ],
    "corrector": [
        ("apo_bench.correction.contact.contact", "apo_bench.scenario.scenario"),
        ("apo_bench.correction.contact.contact", "apo_bench.mjcf.part_file"),
        ("apo_bench.correction.solvers.compact", "apo_bench.simulation.scene.settling"),
    ],
    "rows": [
        ("apo_bench.report.report", "apo_bench.trial.trial"),
        ("apo_bench.statistics.rates", "apo_bench.simulation.scene.scene"),
        ("apo_bench.records.settings", "apo_bench.assembly.goals"),
    ],
    "simulators": [
        ("apo_bench.envs.apo_replay", "mujoco"),
        ("apo_bench.cli.app", "mink"),
        ("apo_bench.parts.part_file", "mujoco"),
    ],
    "dm-control": [
        ("apo_bench.simulation.scene.composing", "dm_control"),
        ("apo_bench.envs.apo_replay", "dm_control"),
        ("apo_bench.envs", "dm_control"),
    ],
    "gymnasium": [("apo_bench.trial.trial", "gymnasium"), ("apo_bench.simulation.scene.scene", "gymnasium")],
}


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph("apo_bench", include_external_packages=True, cache_dir=None)


def keeps(graph: grimp.ImportGraph, contract: str) -> bool:
    """Whether a graph of imports keeps a contract."""
    options = {
        key: str(value) if isinstance(value, bool) else value
        for key, value in CONTRACTS[contract].items()
        if key not in ("id", "name", "type")
    }
    session = {"root_packages": ["apo_bench"], "include_external_packages": True}
    kind = KINDS[CONTRACTS[contract]["type"]]
    check = kind(name=contract, session_options=session, contract_options=options)
    return bool(check.check(graph=deepcopy(graph), verbose=False).kept)  # it takes out the imports that it ignores


def test_a_breach_is_tried_for_every_contract() -> None:
    assert BREACHES.keys() == CONTRACTS.keys()


@pytest.mark.parametrize("contract", CONTRACTS)
def test_the_contract_is_kept(graph: grimp.ImportGraph, contract: str) -> None:
    assert keeps(graph, contract)


@pytest.mark.parametrize(
    ("contract", "importer", "imported"),
    [(name, *breach) for name, breaches in BREACHES.items() for breach in breaches],
)
def test_a_broken_wall_is_seen(graph: grimp.ImportGraph, contract: str, importer: str, imported: str) -> None:
    assert {importer} <= graph.modules
    graph.add_import(importer=importer, imported=imported)
    try:
        assert not keeps(graph, contract)
    finally:
        graph.remove_import(importer=importer, imported=imported)


def test_the_lists_of_rooms_are_complete() -> None:
    """A new room is in the layers, and may not know a simulator or Gymnasium unless somebody says so."""
    package = ROOT / "apo_bench"
    rooms = {
        f"apo_bench.{path.stem}"
        for path in package.iterdir()
        if (path / "__init__.py").is_file() or (path.suffix == ".py" and path.stem != "__init__")
    }
    layers = {f"apo_bench.{room.strip()}" for line in CONTRACTS["layers"]["layers"] for room in line.split("|")}
    assert layers == rooms
    workshop = {"apo_bench.__main__", "apo_bench.cli", *CONTRACTS["workshop"]["forbidden_modules"]}
    assert {*CONTRACTS["workshop"]["source_modules"], *workshop} == rooms
    assert {*CONTRACTS["simulators"]["source_modules"], "apo_bench.simulation", "apo_bench.mjcf"} == rooms
    assert {*CONTRACTS["gymnasium"]["source_modules"], "apo_bench.envs"} == rooms


@pytest.mark.parametrize("room", ["cad", "simulation"])
def test_a_wall_between_subfolders_names_every_subfolder(room: str) -> None:
    subfolders = {path.parent.name for path in (ROOT / "apo_bench" / room).glob("*/__init__.py")}
    assert {each.strip() for line in CONTRACTS[room]["layers"] for each in line.split("|")} == subfolders
