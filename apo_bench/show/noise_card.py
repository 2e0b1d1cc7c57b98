"""The card of a noise model: formula, frame, parameters, and a histogram of what it really does."""

import inspect
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly.goals import Demonstration, placements
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.names import resolve
from apo_bench.observation.models.camera import Camera
from apo_bench.observation.models.level import Facts
from apo_bench.observation.noise import NOISES, Level, make_noise
from apo_bench.observation.noise_file import noise_of_file, read_noise
from apo_bench.observation.observing import observe
from apo_bench.observation.presets import presets
from apo_bench.scenario.file import load_scenario

SCENARIO = "stick_in_tower"
_DRAWS = 1000
"""Observations of that scenario, three operations each, behind a histogram."""
PANELS = ("across the ray", "along the ray", "tilt", "about the ray")
PANEL_UNITS = ("mm", "mm", "deg", "deg")
_BINS = 17
_WIDTH = 14
"""Bins of a histogram in text, the outermost with all that is beyond, and the length of its longest bar."""


class Drawn(NamedTuple):
    """Errors that a model made."""

    errors: Array
    """(m, 4), in the frame of the default camera's ray: across and along in mm, tilt and about the ray in degrees."""
    stated: Array
    """(4,), root mean square of the standard deviations that the observations stated, in the same units."""
    missed: float
    """Share of operations that were not seen."""


def listed_models() -> Mapping[str, str]:
    """Name -> what it is, of every model that has a name."""
    return {name: facts(name).title for name in NOISES} | {
        name: f"measured: {read_noise(path)[0].source.split(':')[0]}" for name, path in presets().items()
    }


def facts(given: Any) -> Facts:
    """What a model says of itself; of one that says nothing, its docstring."""
    model = _model(given)
    own = getattr(model, "FACTS", None)
    if isinstance(own, Facts):
        return own
    said = (inspect.getdoc(model) or "A noise model that says nothing of itself.").split("\n\n")[0]
    return Facts(" ".join(said.split()), (), "", (), "")


def _model(given: Any) -> Any:
    """What a name stands for: a class, or an object that no level changes, but what is measured at level 1."""
    measured = noise_of_file(given, Level(1.0, 1.0)) if isinstance(given, str) else None
    return measured or resolve(given, NOISES, "noise model")


def draw_errors(given: Any, level: Level, draws: int = _DRAWS) -> Drawn:
    """Errors of many observations of the nominal example 5.1; operations that were not seen have none."""
    noise = make_noise(given, level)
    shown = nominal_demonstration()
    camera = Camera()
    rng = np.random.default_rng(0)
    errors = []
    variances = []
    missed = 0
    for _ in range(draws):
        observation = observe(shown, noise, rng)
        Q = np.zeros((len(observation.goals), 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = np.swapaxes(camera.frames(observation.goals), 1, 2) @ observation.goals[:, :3, :3]
        xi = (Q @ pose.log(pose.inverse(shown.goals) @ observation.goals)[..., None])[..., 0]
        errors.append(xi[observation.seen])
        variances.append(
            np.diagonal(Q @ observation.covariance @ np.swapaxes(Q, 1, 2), axis1=1, axis2=2)[observation.seen]
        )
        missed += int(np.sum(~observation.seen))
    scale = np.array([1e3, 1e3, np.degrees(1.0), np.degrees(1.0)])
    some = np.concatenate(errors)[:, [0, 2, 3, 5]] * scale
    stated = np.concatenate(variances)[:, [0, 2, 3, 5]]
    rms = np.sqrt(stated.sum(axis=0) / max(1, len(stated))) * scale
    return Drawn(some, rms, missed / (draws * len(shown.goals)))


def nominal_demonstration() -> Demonstration:
    """What a careful human shows: the nominal goals of example 5.1, in the middle of where they may stand."""
    scenario = load_scenario(SCENARIO)
    T = pose.at(np.append(scenario.site.center_m, 0.0))
    goals = T @ scenario.goals
    final = placements(scenario.assembly, scenario.start, goals)[-1]
    return Demonstration(scenario.assembly, scenario.start, goals, final, np.zeros((len(goals), 6, 6)))


def noise_card(given: Any, level: Level, drawn: Drawn | None = None) -> str:
    """The card of a model in Markdown, with a histogram in text of `drawn` (none: of what `draw_errors` draws)."""
    drawn = drawn or draw_errors(given, level)
    if not len(drawn.errors):
        return f"{model_description(given)}\nNothing was seen: every operation of {SCENARIO} was missed.\n"
    bars = "\n".join(f"    {line}".rstrip() for line in _histogram(drawn))
    return f"{model_description(given)}\n{drawn_sentence(given, drawn, level)}:\n\n{bars}\n"


def model_description(given: Any, heading: int = 1) -> str:
    """What a model says of itself, without a histogram."""
    said = facts(given)
    name = given if isinstance(given, str) else getattr(given, "__name__", type(given).__name__)
    parts = [f"{'#' * heading} {name}: {said.title}"]
    if said.formula:
        parts.append("\n".join(f"    {line}" for line in said.formula))
    lines = [f"Frame: {said.frame}."] * bool(said.frame)
    lines += [f"Parameter {parameter}." for parameter in said.parameters]
    lines += [f"States: {said.states}."] * bool(said.states)
    lines += [f"{note}." for note in said.notes]
    if lines:
        parts.append("\n".join(f"- {line}" for line in lines))
    return "\n\n".join(parts) + "\n"


def drawn_sentence(given: Any, drawn: Drawn, level: Level) -> str:
    """One sentence on what was drawn, without its full stop."""
    if facts(given).measured:
        apart = f" in mm and {level.deg:g} times in deg" if level.deg != level.mm else ""
        where = "as measured" if level == (1.0, 1.0) else f"{level.mm:g} times{apart} what was measured"
    elif isinstance(_model(given), type):
        where = f"at {level.mm:g} mm and {level.deg:g} deg"
    else:
        where = "at every level alike"
    missed = f"; {100 * drawn.missed:.1f} % were not seen" if drawn.missed else ""
    n = f"{len(drawn.errors)} operations of {SCENARIO}"
    return f"Errors {where}, {n}{missed}"


def _histogram(drawn: Drawn) -> list[str]:
    """Bars over bins of half a stated standard deviation, and below them the deviations found and stated."""
    unit = drawn.errors / np.where(drawn.stated > 0.0, drawn.stated, 1.0)
    edges = 0.5 * (np.arange(_BINS - 1) - (_BINS - 2) / 2)
    counts = np.array([np.bincount(np.digitize(column, edges), minlength=_BINS) for column in unit.T])
    longest = max(1, int(counts.max()))
    lines = ["stated".rjust(12) + "".join(f"  {name:{_WIDTH}}" for name in PANELS)]
    for i in range(_BINS):
        low = edges[i - 1] if i else None
        high = edges[i] if i < _BINS - 1 else None
        if low is None:
            where = f"< {high:.2f}"
        elif high is None:
            where = f"> {low:.2f}"
        else:
            where = f"{(low + high) / 2:.1f}"
        bars = ("#" * int(np.ceil(_WIDTH * count / longest)) for count in counts[:, i])
        lines.append(where.rjust(12) + "".join(f"  {bar:{_WIDTH}}" for bar in bars))
    for word, values in (
        ("deviation", np.sqrt(np.mean(drawn.errors**2, axis=0)) if len(drawn.errors) else np.zeros(4)),
        ("stated", drawn.stated),
    ):
        lines.append(
            word.rjust(12) + "".join(f"  {f'{v:.3g} {u}':{_WIDTH}}" for v, u in zip(values, PANEL_UNITS, strict=True))
        )
    return lines
