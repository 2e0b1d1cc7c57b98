"""The card of a noise model: what it says of itself, and a table of the errors that it makes."""

import inspect
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Demonstration, placements
from apo_bench.geometry import Array, pose
from apo_bench.names import resolve
from apo_bench.perception.observation.models import Camera, Facts
from apo_bench.perception.observation.noise import FAILURES, NOISES, NoiseLevel, make_noise
from apo_bench.perception.observation.noise_file import noise_path, presets, read_noise
from apo_bench.perception.observation.observing import observe
from apo_bench.scenario.file import load_scenario

SCENARIO = "stick_in_tower"
_DRAWS = 1000
"""Observations of that scenario, three operations each, behind a table."""
_ERRORS = ("across the ray [mm]", "along the ray [mm]", "tilt [deg]", "about the ray [deg]")
_PERCENTILES = (50, 90, 99)


class Drawn(NamedTuple):
    """Errors that a model made."""

    errors: Array
    """(m, 4), in the frame of the default camera's ray: across and along in mm, tilt and about the ray in degrees."""
    stated: Array
    """(4,), root mean square of the standard deviations that the observations stated, in the same units."""
    missed: float
    """Share of operations that were not seen."""


def list_models() -> Mapping[str, str]:
    """Name -> what it is, of every model that has a name."""
    return {name: find_facts(name).title for name in NOISES} | {
        name: f"measured: {read_noise(path)[0].source.split(':')[0]}" for name, path in presets().items()
    }


def find_facts(model: Any) -> Facts:
    """What a model says of itself; of one that says nothing, its docstring."""
    model = _resolve_model(model)
    title = (inspect.getdoc(model) or "A noise model that says nothing of itself.").split("\n\n")[0]
    own = getattr(model, "FACTS", None)
    return own if isinstance(own, Facts) else Facts(" ".join(title.split()), (), "", (), "")


def draw_errors(model: Any, noise_level: NoiseLevel, draws: int = _DRAWS) -> Drawn:
    """Errors of many observations of the nominal example 5.1; operations that were not seen have none."""
    noise = make_noise(model, noise_level)
    demonstration = nominal_demonstration()
    camera = Camera()
    rng = np.random.default_rng(0)
    errors = []
    variances = []
    for _ in range(draws):
        observation = observe(demonstration, noise, rng)
        # error xi of T Exp(xi), turned from the part's own frame into that of the ray: R_ray^T R_part, for both halves
        Q = np.kron(np.eye(2), np.swapaxes(camera.frames(observation.poses), 1, 2) @ observation.poses[:, :3, :3])
        xi = (Q @ pose.log(pose.inverse(demonstration.poses) @ observation.poses)[..., None])[..., 0]
        errors.append(xi[observation.observed])
        covariance = Q @ observation.covariance @ np.swapaxes(Q, 1, 2)
        variances.append(np.diagonal(covariance, axis1=1, axis2=2)[observation.observed])
    # x is across the ray and z along it; rx tilts it and rz turns about it
    scale = np.array([1e3, 1e3, np.degrees(1.0), np.degrees(1.0)])
    four = np.concatenate(errors)[:, [0, 2, 3, 5]] * scale
    stated = np.concatenate(variances)[:, [0, 2, 3, 5]]
    return Drawn(
        four,
        np.sqrt(stated.sum(axis=0) / max(1, len(stated))) * scale,
        1.0 - len(four) / (draws * len(demonstration.poses)),
    )


def nominal_demonstration() -> Demonstration:
    """What a careful human shows: the nominal goals of example 5.1, in the middle of where they may stand."""
    scenario = load_scenario(SCENARIO)
    goals = pose.at(np.append(scenario.site.center_m, 0.0)) @ scenario.goals
    final = placements(scenario.assembly, scenario.start, goals)[-1]
    return Demonstration(scenario.assembly, scenario.start, goals, final, np.zeros((len(goals), 6, 6)))


def write_card(model: Any, noise_level: NoiseLevel, drawn: Drawn, heading: int = 1) -> str:
    """The card of a model in Markdown, with a table of the errors that were drawn."""
    about = describe_model(model, heading)
    if not len(drawn.errors):
        return f"{about}\nNothing was seen: every operation of {SCENARIO} was missed.\n"
    return "\n".join([about, f"{_describe_draws(model, drawn, noise_level)}:", "", *_tabulate_errors(drawn), ""])


def describe_model(model: Any, heading: int = 1) -> str:
    """What a model says of itself, in Markdown."""
    about = find_facts(model)
    name = model if isinstance(model, str) else getattr(model, "__name__", type(model).__name__)
    lines = (
        *[f"Frame: {about.frame}."] * bool(about.frame),
        *(f"Parameter {parameter}." for parameter in about.parameters),
        *[f"States: {about.states}."] * bool(about.states),
        *(f"{note}." for note in about.notes),
    )
    parts = (
        f"{'#' * heading} {name}: {about.title}",
        "\n".join(f"    {line}" for line in about.formula),
        "\n".join(f"- {line}" for line in lines),
    )
    return "\n\n".join(filter(None, parts)) + "\n"


def _describe_draws(model: Any, drawn: Drawn, noise_level: NoiseLevel) -> str:
    """One sentence on what was drawn, without its full stop."""
    if find_facts(model).measured:
        apart = f" in mm and {noise_level.deg:g} times in deg" if noise_level.deg != noise_level.mm else ""
        where = "as measured" if noise_level == (1.0, 1.0) else f"{noise_level.mm:g} times{apart} what was measured"
    elif (isinstance(model, str) and model.partition(":")[0] in NOISES) or isinstance(_resolve_model(model), type):
        where = f"at {noise_level.mm:g} mm and {noise_level.deg:g} deg"
    else:
        where = "at every level alike"
    missed = f"; {100 * drawn.missed:.1f} % were not seen" if drawn.missed else ""
    return f"Errors {where}, {len(drawn.errors)} operations of {SCENARIO}{missed}"


def _tabulate_errors(drawn: Drawn) -> list[str]:
    """The deviation found and the one stated, and percentiles of the size, of each error: a table in Markdown."""
    found = np.sqrt(np.mean(drawn.errors**2, axis=0))
    sizes = np.percentile(np.abs(drawn.errors), _PERCENTILES, axis=0)
    lines = [_table_line("error", ("deviation", "stated", *(f"p{percentile}" for percentile in _PERCENTILES)))]
    lines.append("|---" * (len(_PERCENTILES) + 3) + "|")
    for name, *numbers in zip(_ERRORS, found, drawn.stated, *sizes, strict=True):
        lines.append(_table_line(name, [f"{number:.3g}" for number in numbers]))
    return lines


def _table_line(name: str, cells: Iterable[str]) -> str:
    return f"| {name:20} |" + "".join(f" {cell:>9} |" for cell in cells)


def _resolve_model(model: Any) -> Any:
    """What a name stands for: a class, or an object that no level changes, but what is measured at level 1."""
    known = isinstance(model, str) and (noise_path(model) is not None or model.partition(":")[0] in FAILURES)
    return make_noise(model, NoiseLevel(1.0, 1.0)) if known else resolve(model, NOISES, "noise model")
