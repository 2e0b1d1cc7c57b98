"""Compare detected contacts with those of the scenario."""

from typing import Any

import numpy as np

from apo_bench.benchmark.analysis.rates import Rate, Records
from apo_bench.benchmark.analysis.table_line import ALL, Line
from apo_bench.records import DETECTED
from apo_bench.records.run.trials import Trials, make_trials

_AXES = ("scenario", "noise", "pose_source", "contact_source", "human_error_scale", "noise_mm", "noise_deg")


def tabulate_detection(records: Records) -> list[Line]:
    """Return one line per scenario, noise, pose source, contact source, human error scale and noise level.

    With several scenarios there are also lines over all of them. All methods of one seed get the same contacts, so each
    observation counts once. A demonstration is complete if exactly its contacts were detected.
    """
    trials = make_trials(records)
    known = ~np.isnan(trials.number("contacts_true_positive")) & ~np.isnan(trials.number("noise_mm"))
    detected = trials.where(known & trials.holds("contact_source", DETECTED.__contains__))
    observations = detected.groups((*_AXES, "seed", "clearance_mm")).of
    once = detected.where(np.unique(observations, return_index=True)[1])  # the first trial of each observation
    parts = once.parts(_AXES)
    if len(once.distinct("scenario")) > 1:
        parts |= {(ALL, *key): own for key, own in once.parts(_AXES[1:]).items()}
    return [_make_line(dict(zip(_AXES, key, strict=True)), parts[key]) for key in sorted(parts, key=_sort_key)]


def _make_line(axes: Line, trials: Trials) -> Line:
    """Return the line of a group of observations, identified by `axes`."""
    missed = trials.number("contacts_false_negative")
    false = trials.number("contacts_false_positive")
    right = int(trials.number("contacts_true_positive").sum())
    return axes | {
        "right": right,
        "missed": int(missed.sum()),
        "false": int(false.sum()),
        "demonstrations": len(trials),
        "complete": Rate(int(((missed == 0) & (false == 0)).sum()), len(trials)),
        "precision": Rate(right, right + int(false.sum())).rate,
        "recall": Rate(right, right + int(missed.sum())).rate,
    }


def _sort_key(key: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return a sort key: all scenarios last, contact sources in the order of `DETECTED`."""
    scenario, noise, pose_source, contact_source, *rest = key
    return (scenario == ALL, scenario, noise, pose_source, DETECTED.index(contact_source), *rest)
