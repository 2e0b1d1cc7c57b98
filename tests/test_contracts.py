"""Import contracts: each is kept, and each breaks when a forbidden import is added."""

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
        ("apo_bench.scenario.scenario_file", "apo_bench.trial.run"),
        ("apo_bench.geometry.pose", "apo_bench.assembly.poses"),
        ("apo_bench.perception.observation.noise", "apo_bench.trial.run"),
    ],
    "scenario": [
        ("apo_bench.scenario.parts.load", "apo_bench.scenario.scenario_file"),
        ("apo_bench.scenario.generated.families", "apo_bench.scenario.layout"),
    ],
    "planning": [("apo_bench.planning.insertion.arrival", "apo_bench.planning.prediction.first_failure")],
    "perception": [
        ("apo_bench.perception.observation.noise", "apo_bench.perception.detection.greedy_detection"),
        ("apo_bench.perception.detection.greedy_detection", "apo_bench.perception.depth_camera.model_localisation"),
    ],
    "benchmark": [
        ("apo_bench.benchmark.sweeps.sweep", "apo_bench.benchmark.report.report"),
        ("apo_bench.benchmark.analysis.rates", "apo_bench.benchmark.sweeps.sweep"),
    ],
    "importers": [
        ("apo_bench.importers.cad.part_import", "apo_bench.importers.assembly.new_scenario"),
        ("apo_bench.importers.assembly.new_scenario", "apo_bench.importers.recording.importing"),
    ],
    "simulation": [
        ("apo_bench.simulation.arms.kinematics", "apo_bench.simulation.scene.world"),
        ("apo_bench.simulation.scene.scene", "apo_bench.simulation.robot.gripper"),
        ("apo_bench.simulation.robot.robot_error", "apo_bench.simulation.execution.transfer"),
        ("apo_bench.simulation.human.hands", "apo_bench.simulation.execution.fingers"),
    ],
    "simulation-loose": [
        ("apo_bench.simulation.physics", "apo_bench.simulation.scene.world"),
        ("apo_bench.simulation.hooks", "apo_bench.simulation.robot.robot"),
    ],
    "cad": [
        ("apo_bench.importers.cad.faces.surface_fitting", "apo_bench.importers.cad.step.surfaces"),
        ("apo_bench.importers.cad.pieces.convex_cutting", "apo_bench.importers.cad.meshes.shells"),
    ],
    "cad-loose": [
        ("apo_bench.importers.cad.pieces.convex_cutting", "apo_bench.importers.cad.contact_faces"),
        ("apo_bench.importers.cad.solids.naming", "apo_bench.importers.cad.part_report"),
    ],
    "correction": [
        ("apo_bench.correction.solvers.gauss_newton", "apo_bench.correction.contact.contact"),
        ("apo_bench.correction.solvers.posterior", "apo_bench.correction.checks.status"),
        ("apo_bench.correction.checks.status", "apo_bench.correction.contact.solved"),
    ],
    "contact": [
        ("apo_bench.correction.contact.problem", "apo_bench.correction.contact.solved"),
        ("apo_bench.correction.contact.inferred", "apo_bench.correction.contact.problem"),
    ],
    "calibration": [
        ("apo_bench.correction.calibration.robust_estimate", "apo_bench.correction.calibration.robot_estimate"),
        ("apo_bench.correction.calibration.robust_estimate", "apo_bench.correction.calibration.robot_estimate"),
    ],
    "importers-used": [
        ("apo_bench.trial.run", "apo_bench.importers.recording.importing"),
        ("apo_bench.viz.task_sheet", "apo_bench.importers.assembly.new_scenario"),
    ],
    "report": [
        ("apo_bench.benchmark.report.page.report_page", "apo_bench.benchmark.report.comparison.text"),
        ("apo_bench.benchmark.report.page.report_page", "apo_bench.benchmark.report.conclusions"),
    ],
    "statistics": [
        ("apo_bench.benchmark.analysis.rates", "apo_bench.benchmark.analysis.half_level"),
        ("apo_bench.benchmark.analysis.settings", "apo_bench.benchmark.analysis.summary"),
    ],
    "sweeps": [
        ("apo_bench.benchmark.sweeps.grid", "apo_bench.benchmark.sweeps.worker"),
        ("apo_bench.benchmark.sweeps.worker", "apo_bench.benchmark.sweeps.pool"),
    ],
    "judge": [
        ("apo_bench.judging.verdict", "apo_bench.perception.observation.noise"),
        ("apo_bench.judging.contact_limits", "apo_bench.perception.detection.greedy_detection"),
    ],
    "corrector": [
        ("apo_bench.correction.contact.contact", "apo_bench.scenario.scenario"),
        ("apo_bench.correction.contact.contact", "apo_bench.mjcf.part_file"),
    ],
    "records": [
        ("apo_bench.benchmark.report.report", "apo_bench.trial.run"),
        ("apo_bench.benchmark.analysis.rates", "apo_bench.simulation.scene.scene"),
    ],
    "simulators": [("apo_bench.envs.apo_replay", "mujoco"), ("apo_bench.cli.app", "mink")],
    "dm-control": [("apo_bench.simulation.scene.composing", "dm_control"), ("apo_bench.envs.apo_replay", "dm_control")],
    "gymnasium": [("apo_bench.trial.run", "gymnasium"), ("apo_bench.simulation.scene.scene", "gymnasium")],
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
def test_a_broken_contract_is_noticed(graph: grimp.ImportGraph, contract: str, importer: str, imported: str) -> None:
    assert {importer} <= graph.modules
    graph.add_import(importer=importer, imported=imported)
    try:
        assert not keeps(graph, contract)
    finally:
        graph.remove_import(importer=importer, imported=imported)


def test_the_lists_of_packages_are_complete() -> None:
    """A new package is in the layers, and knows neither a simulator nor Gymnasium unless it is listed."""
    package = ROOT / "apo_bench"
    packages = {
        f"apo_bench.{path.stem}"
        for path in package.iterdir()
        if (path / "__init__.py").is_file() or (path.suffix == ".py" and path.stem != "__init__")
    }
    layers = {f"apo_bench.{package.strip()}" for line in CONTRACTS["layers"]["layers"] for package in line.split("|")}
    assert layers == packages
    users = {"apo_bench.__main__", "apo_bench.cli", *CONTRACTS["importers-used"]["forbidden_modules"]}
    assert {*CONTRACTS["importers-used"]["source_modules"], *users} == packages
    assert {*CONTRACTS["simulators"]["source_modules"], "apo_bench.simulation", "apo_bench.mjcf"} == packages
    assert {*CONTRACTS["gymnasium"]["source_modules"], "apo_bench.envs"} == packages


@pytest.mark.parametrize("package", ["importers/cad", "simulation"])
def test_a_contract_between_subfolders_names_every_subfolder(package: str) -> None:
    subfolders = {path.parent.name for path in (ROOT / "apo_bench" / package).glob("*/__init__.py")}
    assert {each.strip() for line in CONTRACTS[Path(package).name]["layers"] for each in line.split("|")} == subfolders
