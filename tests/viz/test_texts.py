"""What texts, tables and JSON objects say of small records whose numbers are known."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
from rich.console import Console

from apo_bench import Correction, Observation
from apo_bench.assembly import Consistency, Contact, PartFace
from apo_bench.geometry import pose
from apo_bench.perception.detection.evidence import DetectedContacts, Evidence, Rival
from apo_bench.perception.detection.thresholds import PairThresholds
from apo_bench.viz.correct_text import format_correction, make_correction_form
from apo_bench.viz.detection_text import CONTACT_COLUMNS, make_detection_form
from apo_bench.viz.form_text import make_table
from tests import scenes

ON_TABLE = Contact(PartFace("castle1", "bottom"), PartFace("table", "top"))
BESIDE = Contact(PartFace("castle1", "py"), PartFace("table", "top"))
ALLOWED = PairThresholds(0.003, np.radians(4.0))


def evidence_of(contact: Contact, made: int = 0) -> Evidence:
    """Seen 1.5 mm apart, 0.2 mm inside each other when it was taken, at 0.5 degrees, over a quarter of a face."""
    return Evidence(contact, made, -2e-4, np.radians(0.5), 0.25, ALLOWED, 1.5e-3)


def tower() -> Observation:
    scene = scenes.stick_in_tower()
    return scenes.seen(scene, scene.nominal_poses)


def table_lines(table: object) -> list[list[str]]:
    """The words of every line of a table of `rich`."""
    out = io.StringIO()
    Console(file=out, width=300).print(table)
    return [line.split() for line in out.getvalue().splitlines()]


def corrected(observation: Observation, **changes: object) -> Correction:
    """Everything as seen but the second goal, 3 mm along its own x and turned by 2 degrees about its own z."""
    goals = np.array(observation.poses)
    goals[1] = goals[1] @ pose.at((0.003, 0.0, 0.0), (0.0, 0.0, 2.0))
    correction = Correction(goals, "converged", "all contacts are made", (2, 1, 0), 4e-3, 1e-9, 13)
    return replace(correction, **changes)  # type: ignore[arg-type]


def test_evidence_is_shown_and_written_in_millimetres_and_degrees() -> None:
    observation = tower()
    evidence = (evidence_of(ON_TABLE), evidence_of(BESIDE))
    recognised = DetectedContacts(observation.assembly, evidence, 0.75, Rival(observation.assembly, 0.25))
    form = make_detection_form("tower", "detected", observation, recognised, False)
    _, right, wrong = table_lines(make_table(form["contacts"], CONTACT_COLUMNS))
    numbers = ["1.50", "-0.20", "3.00", "0.50", "4.00", "25%"]
    assert right == ["1", "castle1.bottom", "table.top", *numbers, "True"]
    assert wrong == ["1", "castle1.py", "table.top", *numbers, "False"]
    first, second = form["contacts"]
    assert (first["operation"], first["in_scenario"], second["in_scenario"]) == (1, True, False)
    assert len(form["missed"]) == len(observation.assembly.relations()) - 1
    assert {"operation": 1, "manipulated": "castle1.bottom", "environment": "table.top"} not in form["missed"]
    assert form["next"] == {"probability": 0.25, "with": [], "without": []}
    json.dumps(form, allow_nan=False)


def test_infinite_numbers_of_a_correction_are_null() -> None:
    """JSON knows none: readers of other languages stop at `Infinity`."""
    observation = tower()
    test = Consistency(np.inf, 13, 0.0, 0.01)
    failed = corrected(observation, status="inconsistent", gap_before_m=np.inf, test=test)
    form = make_correction_form("tower", "contact", observation, failed, None, False)
    assert (form["gap_before_mm"], form["gap_after_mm"], form["operations"]) == (None, None, None)
    assert form["test"]["chi_square"] is None
    json.dumps(form, allow_nan=False)
    assert dict(format_correction(form, failed))["test"].endswith("the contacts contradict each other")
