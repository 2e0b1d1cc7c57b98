"""What `apo-bench noise learn` found, as JSON and in words."""

from typing import Any

import numpy as np

from apo_bench.correction.learning.likelihood import EstimatedNumber
from apo_bench.io import columns
from apo_bench.observation.fitting.fit import COMPONENTS
from apo_bench.trial.learned_noise import Learned

_SCHEMA = "apo-bench/noise-learned/1"


def learned_form(learned: Learned) -> dict[str, Any]:
    """Every number with its 95 % interval: mm and degrees."""
    noise = learned.noise
    return {
        "schema": _SCHEMA,
        "source": learned.measured.source,
        "observations": noise.observations,
        "operations": learned.operations,
        "not_seen": learned.unseen,
        "components": [
            {"name": component.name, "unit": component.unit, **estimate._asdict()}
            for component, estimate in zip(COMPONENTS, noise.deviations, strict=True)
        ],
        "outlier_rate": noise.gross._asdict(),
        "looked_again": learned.repeats.looked,
        "repeat_rate": None if (rate := learned.repeats.rate) is None else rate._asdict(),
        "constant_mm_deg": noise.constant.tolist(),
        "constant_covariance_mm_deg": noise.constant_covariance.tolist(),
        "log_likelihood": noise.log_likelihood,
    }


def learned_lines(learned: Learned) -> list[str]:
    """The same in words, line by line; numbers in brackets are 95 % intervals."""
    noise = learned.noise
    facts = [
        ("source", learned.measured.source),
        ("observations", f"{noise.observations}, {learned.operations} operations, {learned.unseen} of them not seen"),
        *((of.name, _estimate(found, of.unit)) for of, found in zip(COMPONENTS, noise.deviations, strict=True)),
        ("outliers", f"{_percent(noise.gross)} of what was seen"),
    ]
    if (rate := learned.repeats.rate) is not None:
        facts.append(("repeated", f"{_percent(rate)} of outliers, {learned.repeats.looked} were looked at again"))
    if noise.constant.any():
        each = [
            f"{x:.2f} +- {s:.2f}"
            for x, s in zip(noise.constant, np.sqrt(np.diag(noise.constant_covariance)), strict=True)
        ]
        facts.append(("constant error", f"({', '.join(each[:3])}) mm, ({', '.join(each[3:])}) deg, axes of the camera"))
    return columns(facts)


def _percent(estimate: EstimatedNumber) -> str:
    """`8.5 % [6.9 to 10.5]`."""
    value, low, high = (100.0 * x for x in estimate)
    return f"{value:.1f} % [{low:.1f} to {high:.1f}]"


def _estimate(estimate: EstimatedNumber, unit: str) -> str:
    """`0.46 mm [0.40 to 0.54]`, or `none found, at most 1.03 mm`."""
    if estimate.low == 0.0:
        return f"none found, at most {estimate.high:.2g} {unit}"
    return f"{estimate.value:.3g} {unit} [{estimate.low:.3g} to {estimate.high:.3g}]"
