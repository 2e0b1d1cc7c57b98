"""A trial always has a row: where its corrector misbehaves, its process dies or its time is over, a failed one."""

from __future__ import annotations

import re
from typing import Any

from apo_bench.assembly.reached import Outcome
from apo_bench.correction.correctors import CorrectorMisbehaved
from apo_bench.correction.own_code.own import CorrectorLost
from apo_bench.records.outcomes import sentence
from apo_bench.records.row import Row
from apo_bench.records.run.checked import unwritable
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.fingerprint import spec_hash
from apo_bench.trial.row import head, result
from apo_bench.trial.stages import SimulatedDemonstration
from apo_bench.trial.trial import run_trial

_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+")


def trial_row(spec: TrialSettings, scene: Scene, simulated: SimulatedDemonstration, content: str, **more: Any) -> Row:
    """The row of a trial, also of one whose corrector misbehaved.

    What code of somebody's own returned may be what no row can hold; that is its failure too.

    Args:
        more: Further arguments of `run_trial`.

    Raises:
        InputError: The request cannot be honoured.
    """
    try:
        row = run_trial(spec, scene, simulated=simulated, content=content, **more)
        wrong = unwritable(row) if ":" in spec.method else ""
        said = f"the corrector '{spec.method}' returned what no row can hold ({wrong})"
    except CorrectorLost as error:
        return lost(spec, content, error.code, "corrector")
    except CorrectorMisbehaved as error:
        wrong = said = str(error)
    return misbehaved(spec, content, simulated.demonstration.code, said) if wrong else row


def lost(spec: TrialSettings, content: str, code: str, what: str = "trial") -> Row:
    """The failed row of a trial whose process, or that of its corrector, died (`worker_died`) or took too long.

    Nothing is compiled for it, and it says nothing of wall times, so that it is the same wherever it happens.

    Args:
        content: From the lock of the sweep: `lock.content[spec.scenario]`.
        code: `worker_died` or `time_limit`.
        what: Whose process died or whose limit it was: `trial` or `corrector`.
    """
    return _failed(spec, content, None, Outcome("worker", code, None, sentence(code, what=what)))


def misbehaved(spec: TrialSettings, content: str, demonstration: str, said: str) -> Row:
    """The failed row of a trial whose corrector raised an error or returned what it must not.

    Args:
        said: What it did; addresses of objects, which differ from run to run, are left out.
    """
    said = _ADDRESS.sub("0x...", said.encode(errors="replace").decode())
    return _failed(spec, content, demonstration, Outcome("correct", "raised", None, said))


def _failed(spec: TrialSettings, content: str, demonstration: str | None, end: Outcome) -> Row:
    first = head(spec, load_scenario(spec.scenario), spec_hash(spec, content))
    return first | {"demonstration": demonstration} | result(end, success=False)
