"""Trials that measure predicted success: the prediction for a plan, and whether it succeeded."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.perception.observation.noise import Noise
from apo_bench.perception.observation.wrong_contacts import make_contacts, replace_contacts
from apo_bench.records import NO_ROBOT_ERROR, TrialConfig
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.planning import apply_method
from apo_bench.trial.predicted_success import predict_success
from apo_bench.trial.run import noise_of, run_trial
from apo_bench.trial.trial_stages import (
    CONTACT_SOURCE,
    SimulatedDemonstration,
    draw_robot_error,
    observe_demonstration,
    replay_and_judge,
    scene_of,
    simulate_demonstration,
    stream,
    trial_outcome,
)
from benchmarks.block_assemblies import scenario_of_blocks
from benchmarks.generated import scenario_of
from benchmarks.held_out import CONTACTS, NOISES

CALIBRATION = "calibration"
HELD_OUT = "held-out"
NO_PLAN = "no_plan"  # code of a trial whose method made no plan
SCENARIOS = (
    *("stick_in_tower", "vanished_fixture", "pocket_table", "carried_bridge", "block_on_block", "bridge_cycle"),
    *("stick_on_castles", "l_bracket_on_plate", "wedge_under_roof", "dovetail", "shaft_through_brackets"),
    *("peg_in_hole", "fixture_alignment", "nested_bushings"),
)
COLUMNS = ("set", "scenario", "seed", "condition", "success", "code", "predicted")


class Condition(NamedTuple):
    """The settings of a trial, but for its scenario."""

    method: str
    noise: str
    """Of the package, or of `held_out`."""
    noise_mm: float = 1.0
    contacts: str = "given"
    """Likewise."""
    play: float = 1.0
    """Clearance as a multiple of that of the scenario."""
    robot_error: str = NO_ROBOT_ERROR
    hidden: bool = False
    """Whether the errors of the robot are not stated."""

    @property
    def name(self) -> str:
        """The settings that are not usual, in words."""
        words = [self.method, f"{self.noise} {self.noise_mm:g}".removesuffix(" 1")]
        words += [] if self.contacts == "given" else [self.contacts]
        words += [] if self.play == 1.0 else [f"play x {self.play:g}"]
        words += [] if self.robot_error == NO_ROBOT_ERROR else [("hidden " if self.hidden else "") + self.robot_error]
        return ", ".join(words)


_FAILING = ("megapose-tless", "flips", "stale", "swaps", "rays", "displaced-view")
LEARNED = (
    *(Condition("contact-robust", noise) for noise in (*_FAILING, "isotropic", "heavy-tailed", "anisotropic")),
    *(Condition("contact-robust", "isotropic", noise_mm) for noise_mm in (8.0, 3.0)),
    *(Condition("contact", noise) for noise in ("stale", "isotropic", "heavy-tailed")),
    *(
        Condition(method, "isotropic", 1.0, contacts)
        for method in ("contact-robust", "contact")
        for contacts in ("false-negative", "false-positive", "face-offset:3mm", "face-offset:1mm")
    ),
    *(Condition("contact-robust", "isotropic", 1.0, "given", play) for play in (0.4, 0.2)),
    *(Condition("snap", "isotropic", noise_mm) for noise_mm in (0.1, 0.25)),
    Condition("uncorrected", "isotropic", 0.1),
    *(
        Condition("contact-robust", "isotropic", 1.0, robot_error=error)
        for error in ("hand_eye:0.1/0.02", "tool:0.1", "in_hand:0.1/0.2", "joints:0.01", "tool:0.25")
    ),
    Condition("contact-robust", "isotropic", 1.0, robot_error="tool:0.05", hidden=True),
)
"""Conditions of generated assemblies, on which the prediction is calibrated."""
TESTED = (
    *(Condition("contact-robust", noise) for noise in NOISES if noise != "white"),
    Condition("contact", "lag"),
    *(Condition("contact-robust", "white", 1.0, wrong) for wrong in ("false-negative", "false-positive", *CONTACTS)),
    *(Condition("contact", "white", 1.0, wrong) for wrong in ("false-negative", "false-positive", "shift_a_little")),
    *(Condition("contact-robust", "one_camera", 1.0, "given", play) for play in (0.5, 0.25)),
    Condition("contact-robust", "white", 1.0, "given", 1.0, "tool:0.15"),
    Condition("contact-robust", "white", 1.0, "given", 1.0, "hand_eye:0.15/0.03"),
    Condition("contact-robust", "white", 1.0, "given", 1.0, "tool:0.05+joints:0.005", hidden=True),
)
"""Conditions of the scenarios of the benchmark, which test it."""
Line = Mapping[str, str]


class Planned(NamedTuple):
    """A plan with what its planner knew, from which its success can be predicted again."""

    line: Line
    clearance_mm: float
    made: Any
    """The `MethodResult`."""
    given: Any
    """The observation with its contacts."""
    robot_error: str
    """As stated."""
    contacts: str
    """Source of the contacts, as stated."""


def read_lines(path: Path) -> list[Line]:
    """Return the saved trials."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def save(path: Path, lines: Iterable[Line]) -> None:
    """Append trials to a file."""
    new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(lines)


def generate(folder: Path, kind: str, number: int) -> str:
    """Write a generated assembly unless it is there, and return its file.

    Args:
        kind: `blocks`, or `generated`: with round parts, which take ten times as long.
    """
    name = f"{kind}_{number}"
    path = folder / name / f"{name}.toml"
    if not path.exists():
        (scenario_of if kind == "generated" else scenario_of_blocks)(number, path.parent)
    return str(path)


def can_be_built(scenario: str) -> bool:
    """Return whether the method `oracle` builds an assembly without noise of the robot."""
    scene = scene_with(scenario)
    return bool(run_trial(_settings(scenario, scene, 1, Condition("oracle", "isotropic")), scene)["success"])


@lru_cache(maxsize=4)
def scene_with(scenario: str, play: float = 1.0) -> Scene:
    """Return the scene of a scenario with a multiple of its clearance."""
    loaded = load_scenario(scenario)
    return scene_of(TrialConfig(scenario, clearance_mm=play * loaded.clearance_mm), loaded)


def _settings(scenario: str, scene: Scene, seed: int, condition: Condition) -> TrialConfig:
    return TrialConfig(
        scenario,
        method=condition.method,
        noise="isotropic" if condition.noise in NOISES else condition.noise,
        noise_mm=condition.noise_mm,
        noise_deg=condition.noise_mm,
        robot_error=condition.robot_error,
        clearance_mm=scene.clearance_mm,
        seed=seed,
        fidelity="near-contact",
    )


def run_conditions(
    kind: str, name: str, scenario: str, seed: int, conditions: Sequence[Condition]
) -> Iterator[Planned]:
    """Run a trial of each condition of one scenario and seed.

    Args:
        kind: The set that the lines name.
        name: Of the scenario, in the lines.
        scenario: Name or file.
    """
    for play in dict.fromkeys(condition.play for condition in conditions):
        scene = scene_with(scenario, play)
        simulated = simulate_demonstration(scene, 1.0, seed)
        cache = ReplayCache()
        for condition in conditions if simulated.demonstration.code == "ok" else ():
            if condition.play == play:
                planned = _run(_settings(scenario, scene, seed, condition), condition, scene, simulated, cache)
                known = {"set": kind, "scenario": name, "seed": str(seed), "condition": condition.name}
                yield planned._replace(line={**known, **planned.line})


def prediction_of(planned: Planned, scene: Scene) -> str:
    """Return the predicted success of a plan, as it is saved; empty without a plan."""
    made = planned.made
    if made.plan is None:
        return ""
    known = {"robot_error": planned.robot_error, "contact_source": planned.contacts}
    return repr(predict_success(made.plan, planned.given, made.correction, scene, **known))


def _run(
    settings: TrialConfig, condition: Condition, scene: Scene, simulated: SimulatedDemonstration, cache: ReplayCache
) -> Planned:
    noise: Noise = NOISES.get(condition.noise) or noise_of(settings, scene, simulated)
    seen = observe_demonstration(simulated, noise, settings.seed)
    truth = simulated.layout.poses
    source = make_contacts(CONTACTS.get(condition.contacts, condition.contacts))
    given = replace_contacts(seen, source, truth, stream(settings.seed, CONTACT_SOURCE))
    made = apply_method(settings.method, given, None, where=scene)
    stated = NO_ROBOT_ERROR if condition.hidden else settings.robot_error
    contacts = f"benchmarks.held_out:{condition.contacts}" if condition.contacts in CONTACTS else condition.contacts
    planned = Planned({}, scene.clearance_mm, made, given, stated, contacts)
    line = {"success": "0", "code": NO_PLAN, "predicted": prediction_of(planned, scene)}
    if made.plan is not None:
        plan = replace(made.plan, assembly=seen.assembly)
        config = ExecutionConfig(
            settings.fidelity, robot_error=draw_robot_error(settings.robot_error, scene, settings.seed)
        )
        attempt = replay_and_judge(plan, scene, truth, None, config, cache)
        line |= {"success": str(int(attempt.verdict.success)), "code": trial_outcome(attempt).code}
    return planned._replace(line=line)
