"""What texts, tables and JSON objects say of small records whose numbers are known."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from apo_bench import Correction, Observation
from apo_bench.assembly import Consistency, Contact, PartFace, relation_graph
from apo_bench.correction.learning.likelihood import EstimatedNumber
from apo_bench.geometry import pose
from apo_bench.observation.fitting.fit import COMPONENTS, fit_noise, goodness_of_fit
from apo_bench.observation.noise import Level
from apo_bench.recognition.thresholds import Evidence, PairThresholds, Recognised, Rival
from apo_bench.show.arm_text import list_line
from apo_bench.show.correct_text import correction_form, correction_lines, pose_table
from apo_bench.show.fit_text import fit_form, fit_lines
from apo_bench.show.graph.text import graph_form, graph_lines
from apo_bench.show.learned_text import learned_lines
from apo_bench.show.noise_card import Drawn, noise_card
from apo_bench.show.recognised_text import confidence_line, difference_lines, evidence_table, recognition_form
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial.learned_noise import Repeats
from tests import bop_made, scenes

ON_TABLE = Contact(PartFace("castle1", "bottom"), PartFace("table", "top"))
BESIDE = Contact(PartFace("castle1", "py"), PartFace("table", "top"))
ALLOWED = PairThresholds(0.003, np.radians(4.0))


def evidence_of(contact: Contact, made: int = 0) -> Evidence:
    """Seen 1.5 mm apart, 0.2 mm inside each other when it was taken, at 0.5 degrees, over a quarter of a face."""
    return Evidence(contact, made, -2e-4, np.radians(0.5), 0.25, ALLOWED, 1.5e-3)


def tower() -> Observation:
    scene = scenes.stick_in_tower()
    return scenes.seen(scene, scene.goals)


def table_lines(table: object) -> list[list[str]]:
    """The words of every line of a table of `rich`."""
    out = io.StringIO()
    Console(file=out, width=300).print(table)
    return [line.split() for line in out.getvalue().splitlines()]


def corrected(observation: Observation, **changes: object) -> Correction:
    """Everything as seen but the second goal, 3 mm along its own x and turned by 2 degrees about its own z."""
    goals = np.array(observation.goals)
    goals[1] = goals[1] @ pose.at((0.003, 0.0, 0.0), (0.0, 0.0, 2.0))
    correction = Correction(goals, "converged", "all contacts are made", (2, 1, 0), 4e-3, 1e-9, 13)
    return replace(correction, **changes)  # type: ignore[arg-type]


def test_evidence_is_shown_in_millimetres_and_degrees() -> None:
    observation = tower()
    recognised = Recognised(observation.assembly, (evidence_of(ON_TABLE), evidence_of(BESIDE)))
    _, right, wrong = table_lines(evidence_table(recognised, observation.assembly))
    numbers = ["1.50", "-0.20", "3.00", "0.50", "4.00", "25", "%"]
    assert right == ["1", "castle1.bottom", "table.top", *numbers]
    assert wrong == ["1", "castle1.py", "table.top", *numbers, "not", "in", "the", "scenario"]


def test_what_was_recognised_is_written_with_units() -> None:
    observation = tower()
    rival = Rival(observation.assembly, 0.25)
    recognised = Recognised(observation.assembly, (evidence_of(ON_TABLE), evidence_of(BESIDE)), 0.75, rival)
    form = recognition_form("tower", "recognised", observation, recognised, False)
    first, second = form["contacts"]
    assert (first["seen_gap_mm"], first["gap_mm"], first["allowed_gap_mm"]) == (1.5, -0.2, 3.0)
    assert first["angle_deg"] == pytest.approx(0.5)
    assert (first["operation"], first["in_scenario"], second["in_scenario"]) == (1, True, False)
    assert len(form["missed"]) == len(observation.assembly.relations()) - 1
    assert {"operation": 1, "manipulated": "castle1.bottom", "environment": "table.top"} not in form["missed"]
    assert form["next"] == {"probability": 0.25, "with": [], "without": []}
    json.dumps(form, allow_nan=False)


def test_a_set_of_contacts_that_is_not_likely_is_called_not_certain() -> None:
    assembly = tower().assembly
    fewer = scenes.scene(list(assembly.solids.values()), assembly.operations[:2], scenes.stick_in_tower().goals[:2])
    recognised = Recognised(assembly, (), 0.75, Rival(fewer.assembly, 0.25))
    (line,) = confidence_line(recognised)
    assert line.startswith("not certain: this set of contacts is right with probability 0.75")
    assert "the next (0.25) is without 3: stick." in line
    assert confidence_line(replace(recognised, probability=0.95, rival=None))[0].startswith("this set")
    assert confidence_line(replace(recognised, probability=None)) == []


def test_contacts_that_were_missed_are_named() -> None:
    observation = tower()
    every = tuple(evidence_of(r.contact, r.made) for r in observation.assembly.relations())
    recognised = Recognised(observation.assembly, every)
    assert difference_lines(observation, recognised) == [
        f"all {len(every)} contacts of the scenario were recognised, and no other"
    ]
    fewer = scenes.scene(list(observation.assembly.solids.values()), observation.assembly.operations[:1], [np.eye(4)])
    first, *missed = difference_lines(observation, Recognised(fewer.assembly, every[:1]))
    assert first.startswith(f"1 of the {len(every)} contacts")
    assert len(missed) == len(every) - 1
    assert missed[0].startswith("missed: 2: castle2.")


def test_residuals_of_a_graph_are_said_with_what_is_above_the_gap() -> None:
    graph = relation_graph(scenes.pockets().assembly, 6)
    lines = graph_lines("pockets", graph, [None, *([2e-3] * 7), 5e-5], 1e-4)
    arcs = [line for line in lines if line.startswith("R")]
    assert arcs[0].endswith("not seen")
    assert all(line.endswith("2.000 mm, above 0.1") for line in arcs[1:8])
    assert arcs[8].endswith("0.050 mm")
    assert "made 1, lost at 4" in arcs[0]
    assert [line.split("  ")[0] for line in lines if line.endswith("moved on")] == [
        "cube1 (1): T1",
        "cube2 (2): T2",
        "cube3 (3): T3",
    ]
    form = graph_form("pockets", graph, [None, *([2e-3] * 7), 5e-5])
    assert [arc["residual_mm"] for arc in form["arcs"]] == [None, *([2.0] * 7), 0.05]
    assert [node["stands"] for node in form["nodes"]] == [True, False, False, False, True, True, True, True]


def test_a_correction_is_said_with_how_far_it_moved_each_goal() -> None:
    observation = tower()
    rows = table_lines(pose_table(observation, corrected(observation)))[1:]
    assert [row[-2:] for row in rows] == [["0.000", "0.000"], ["3.000", "2.000"], ["0.000", "0.000"]]
    form = correction_form("tower", "contact", observation, corrected(observation), None, False)
    second = form["operations"][1]
    assert (second["operation"], second["part"]) == (2, "castle2")
    assert (second["moved_mm"], second["turned_deg"]) == (pytest.approx(3.0), pytest.approx(2.0))
    assert (form["gap_before_mm"], form["gap_after_mm"]) == (pytest.approx(4.0), pytest.approx(1e-6))


def test_infinite_numbers_of_a_correction_are_null() -> None:
    """JSON knows none: readers of other languages stop at `Infinity`."""
    observation = tower()
    test = Consistency(np.inf, 13, 0.0, 0.01)
    failed = corrected(observation, status="inconsistent", gap_before_m=np.inf, test=test)
    form = correction_form("tower", "contact", observation, failed, None, False)
    assert (form["gap_before_mm"], form["gap_after_mm"], form["operations"]) == (None, None, None)
    assert form["test"]["chi_square"] is None
    json.dumps(form, allow_nan=False)
    assert dict(correction_lines(observation, failed, None))["test"].endswith("the contacts contradict each other")


def test_a_camera_that_sees_nothing_has_a_card_without_a_histogram() -> None:
    nothing = Drawn(np.zeros((0, 4)), np.zeros(4), 1.0)
    text = noise_card("isotropic", Level(1.0, 1.0), nothing)
    assert text.endswith("Nothing was seen: every operation of stick_in_tower was missed.\n")
    assert "stated" not in text.splitlines()[-1]


def test_the_histogram_of_a_card_counts_what_was_drawn() -> None:
    """Two errors of one stated deviation to each side, and one beyond all bins, in the first of four columns."""
    errors = np.zeros((5, 4))
    errors[:, 0] = [2.0, 2.0, -2.0, -2.0, 100.0]
    text = noise_card("isotropic", Level(1.0, 1.0), Drawn(errors, np.array([2.0, 1.0, 1.0, 1.0]), 0.0))
    bars = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.startswith("     ")}
    assert bars["1.0"] == bars["-1.0"] == ["######"]
    assert bars[">"] == ["3.75", "###"]
    assert bars["0.0"] == ["#" * 14] * 3
    assert bars["stated"][:2] == ["2", "mm"]


def test_estimates_left_over_are_counted_per_image(tmp_path: Path) -> None:
    from apo_bench.files.bop import read_results
    from apo_bench.files.bop_truth import read_truth
    from apo_bench.observation.models.residuals import match_residuals

    drawn = bop_made.draw(600, bop_made.Known(), np.random.default_rng(5))
    estimates, truth = bop_made.files(tmp_path, drawn)
    found = estimates.read_text(encoding="utf-8").splitlines()
    absent = [",".join([*line.split(",")[:2], "77", *line.split(",")[3:]]) for line in found[1:61:5]]
    estimates.write_text("\n".join([*found, *dict.fromkeys(absent)]) + "\n", encoding="utf-8")
    seen = read_results(estimates)
    residuals = match_residuals(seen, read_truth(truth, seen))
    measured = fit_noise(residuals, "made")
    figures = goodness_of_fit(residuals, measured)
    form = fit_form(residuals, measured, figures)
    assert (form["parts"], form["images"]) == (600, 120)
    assert form["left_over"] == residuals.surplus > 0
    text = "\n".join(fit_lines(residuals, measured, figures))
    assert f"{residuals.surplus} estimates left over, {residuals.surplus / 120:.2g} per image" in text
    assert f"{form['found']}; {600 - form['found']} missed ({100 * measured.missed:.1f} %)" in text
    json.dumps(form, allow_nan=False)


def test_what_noise_was_learned_is_said_with_its_interval() -> None:
    from types import SimpleNamespace

    estimates = [EstimatedNumber(0.46, 0.4, 0.54), *([EstimatedNumber(0.0, 0.0, 1.03)] * (len(COMPONENTS) - 1))]
    noise = SimpleNamespace(
        observations=12,
        deviations=estimates,
        gross=EstimatedNumber(0.05, 0.01, 0.2),
        constant=np.array([1.0, 0, 0, 0, 0, 0.5]),
        constant_covariance=np.diag([0.04, 0.04, 0.04, 0.01, 0.01, 0.01]),
    )
    measured = SimpleNamespace(source="made")
    found = SimpleNamespace(noise=noise, measured=measured, operations=36, unseen=2, repeats=Repeats(3, 5))
    lines = learned_lines(found)  # type: ignore[arg-type]
    first, second = COMPONENTS[:2]
    assert lines[1].endswith("12, 36 operations, 2 of them not seen")
    assert lines[2].split(first.name)[1].strip() == f"0.46 {first.unit} [0.4 to 0.54]"
    assert lines[3].split(second.name)[1].strip() == f"none found, at most 1 {second.unit}"
    assert lines[-3].endswith("5.0 % [1.0 to 20.0] of what was seen")
    assert lines[-2].endswith("58.3 % [20.9 to 90.6] of outliers, 5 were looked at again")
    assert "(1.00 +- 0.20, 0.00 +- 0.20, 0.00 +- 0.20) mm, (0.00 +- 0.10, 0.00 +- 0.10, 0.50 +- 0.10) deg" in lines[-1]


def test_an_arm_is_listed_with_what_it_can_hold() -> None:
    arm = find_arm("six_axis")
    line = list_line("six_axis", arm)
    assert line.startswith(f"six_axis: 6 joints, opens {2e3 * arm.opening_m:.1f} mm")
    assert line.endswith(f"; {arm.control}")
