"""Fit a plan: move its target poses along free directions until it is predicted to fit, stable and in reach.

The plan is left as it is if it fits, if its contacts are misaligned (which no free direction repairs), and if no choice
is found. The contacts are those that the corrector was given.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Correction, Observation, Plan, build_contact_equations, list_poses_between_undos
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.first_failure import predict_failure
from apo_bench.planning.prediction.measure import Measure
from apo_bench.planning.prediction.plan_measures import measure_plan
from apo_bench.scenario.scenario import Scenario
from apo_bench.simulation.execution import in_reach
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.trial.free_directions import find_free_space, find_nearest_fitting_poses

MARGINS_MM = (2.0, 0.5)
"""Distances to keep between parts, and of the centre of mass from an edge; the second is tried if the first fails."""
_LIMIT_SLACK = 0.01
"""Room that a plan with less than the wanted room may still lose [mm]."""
_LARGE_LIMIT = ("on_way", "from_above")
"""Kinds of measures that are distances between parts."""
_EXACT_M = 1e-9
"""Contacts with a smaller gap count as closed."""
_LEAST_MM = 0.01
"""Smaller moves are not listed."""
_LEAST_DEG = 0.01
"""Smaller moves are not listed."""


class FreeMove(NamedTuple):
    """The move of one target pose along free directions of its contacts."""

    operation: int
    """Counted from 0."""
    shift_mm: float
    turn_deg: float


@final
@dataclass(frozen=True, eq=False)
class FittingPlan:
    """A plan, and the moves that made it fit."""

    plan: Plan
    moves: tuple[FreeMove, ...] = ()
    """The poses that differ from the correction, in the order of operations."""
    why: str = ""
    """The failure predicted without the moves; empty if nothing was moved."""

    @property
    def sentence(self) -> str:
        """The moves in words, such as `moved where contacts leave it free: operation 5 (cube) by 9.6 mm; otherwise ..`.

        Empty if nothing was moved.
        """
        if not self.moves:
            return ""
        mains = [operation.main for operation in self.plan.assembly.operations]
        named = [
            # The boolean factor omits rotations that would print as 0.0.
            f"operation {k + 1} ({mains[k]}) by {shift_mm:.1f} mm" + f" and {turn_deg:.1f} deg" * (turn_deg >= 0.05)
            for k, shift_mm, turn_deg in self.moves
        ]
        return f"moved where contacts leave it free: {', '.join(named)}; otherwise {self.why}"


@check_arguments
def fit_plan(correction: Correction, observation: Observation, where: Scene | Scenario) -> FittingPlan:
    """Make the plan of a correction and move it along free directions so that every motion fits and is in reach.

    Args:
        correction: From `correct`.
        observation: The observation that was corrected.
        where: The scene of the execution. For a scenario, which is compiled if needed, a plan that is predicted to fit
            counts as in reach.

    Returns:
        The plan, and its moves along free directions.

    Raises:
        InputError: The correction did not converge.
    """
    plan = correction.plan(observation)
    if isinstance(where, Scenario):
        if not predict_failure(plan, where.clearance_mm, where.thresholds, where.attach).fails:
            return FittingPlan(plan)
        where = build_scene(where)
    why = _predict_fault(where, plan)
    goals = _find_fitting_poses(plan, correction.assumed or observation, where) if why else None
    if why is None or goals is None:
        return FittingPlan(plan)
    return FittingPlan(plan.with_target_poses(goals), _list_moves(plan.target_poses, goals), why)


def _predict_fault(scene: Scene, plan: Plan) -> str | None:
    """The predicted failure of a plan, or that it is out of reach.

    Returns:
        None if nothing is wrong; empty if the failure cannot be repaired along free directions.
    """
    prediction = predict_failure(plan, scene.clearance_mm, scene.scenario.thresholds, scene.scenario.attach)
    if prediction.fails:
        return prediction.sentence if prediction.is_correctable else ""
    return None if in_reach(plan, scene) else "the arm would not reach all of it"


def _measure_plan(scene: Scene, plan: Plan, room_mm: float = 0.0) -> tuple[Measure, ...]:
    """The measures of a plan, as `predict_failure` compares them.

    Args:
        room_mm: Stability must hold with the centre of mass this far off.
    """
    return tuple(measure_plan(plan, scene.clearance_mm, scene.scenario.thresholds, scene.scenario.attach, room_mm))


def _find_fitting_poses(plan: Plan, observation: Observation, scene: Scene) -> Array | None:
    """Target poses, (n, 4, 4), near those of the plan, at which it fits; None if none were found.

    Args:
        plan: A plan that does not fit.
        observation: The observation with the contacts and covariances that define the free directions.
    """
    try:
        space = find_free_space(observation, plan.target_poses)
    except InputError:
        return None
    if space is None:
        return None
    before = _measure_plan(scene, plan)
    allowed = _measure_earlier_gaps(plan)

    def fits(goals: Array) -> bool:
        """Whether contacts hold as well as before, also those broken later, and nothing is predicted to fail."""
        moved = plan.with_target_poses(goals)
        fixed_operations = all(
            (poses <= np.maximum(most, _EXACT_M)).all()
            for poses, most in zip(_measure_earlier_gaps(moved), allowed, strict=True)
        )
        return fixed_operations and _predict_fault(scene, moved) is None  # None: nothing fails

    for room_mm in MARGINS_MM:
        limits = _list_limits(before, _measure_plan(scene, plan, room_mm), room_mm)
        fitting_goals = find_nearest_fitting_poses(space, fits, partial(_measure_excess, plan, scene, room_mm, limits))
        if fitting_goals is not None:
            return fitting_goals
    return None


def _measure_excess(plan: Plan, scene: Scene, room_mm: float, limits: Array, goals: Array) -> Array:
    """Size less limit of each measure of the plan with target poses `goals`, (k,), [mm]."""
    return np.array([measure.size for measure in _measure_plan(scene, plan.with_target_poses(goals), room_mm)]) - limits


def _list_limits(before: tuple[Measure, ...], with_room: tuple[Measure, ...], room_mm: float) -> Array:
    """The limit of each measure, (k,), [mm].

    Distances between parts must be at least `room_mm`. Where the plan has less and does not fail, it must keep what it
    has. The same holds for the balance of a part.

    Args:
        before: The measures of the plan.
        with_room: The same measures with `room_mm`.
    """
    limits = []
    for plain, roomy in zip(before, with_room, strict=True):
        wanted = -room_mm if plain.kind in _LARGE_LIMIT else plain.allowed
        had = (plain.kind == "falls" and not plain.exceeded) or (plain.kind in _LARGE_LIMIT and plain.size <= 0.0)
        # Sizes of distances are negative: a larger size is less room.
        limits.append(max(wanted, roomy.size + _LIMIT_SLACK) if had and roomy.size > wanted else wanted)
    return np.array(limits)


def _measure_earlier_gaps(plan: Plan) -> list[Array]:
    """The largest |e| of each contact, [m], one array for each time before parts are taken apart again."""
    return [
        build_contact_equations(plan.assembly.first(upto), plan.start, goals[:upto]).gaps(goals[:upto])
        # The last entry is the end of the plan; the search itself keeps those contacts.
        for upto, goals in list_poses_between_undos(plan)[:-1]
    ]


def _list_moves(before: Array, after: Array) -> tuple[FreeMove, ...]:
    """The moves between target poses `before` and `after`, (n, 4, 4) each, without negligible ones."""
    shifts = 1e3 * np.linalg.norm(after[:, :3, 3] - before[:, :3, 3], axis=1)
    turns = np.degrees(np.linalg.norm(pose.log(pose.inverse(before) @ after)[:, 3:], axis=1))
    return tuple(
        FreeMove(k, float(shift), float(turn))
        for k, (shift, turn) in enumerate(zip(shifts, turns, strict=True))
        if shift > _LEAST_MM or turn > _LEAST_DEG
    )
