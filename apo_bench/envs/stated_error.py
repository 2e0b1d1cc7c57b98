"""The stated error of a held part relative to its hole, which the same robot built: hand-eye errors partly cancel.

Errors are small, so they add, as twists along world axes. Each independent error of the robot is carried through all
earlier operations alone (`robot_draws`). Pads that meet a part off its middle push it along until both touch, which
disturbs it in the hand in proportion. What is left between the held part and those that it goes into is the error that
matters.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly import (
    Observation,
    Plan,
    Poses,
    compute_joint_covariance,
    compute_placements,
    project_round_faces,
)
from apo_bench.assembly.equations import build_contact_equations
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.rest_poses import is_insertion
from apo_bench.simulation.execution import Grip, Move, compute_transferred_poses
from apo_bench.simulation.robot import RobotError, translate
from apo_bench.simulation.scene import Scene
from apo_bench.trial.robot_draws import KEPT, bring, list_unit_errors, place_part, stack_errors, twist_in_open_hand

_DRAGGED = np.array([0.023, 0.038, 0.085, *np.radians([18.0, 50.0, 105.0])])
"""What a grasp adds to the twist of a part in the hand, (6,), 1 sigma, for each metre that the pads push it, [m/m,
rad/m]; the tilt about the second axis is that of a part of 1 N, since heavy parts tilt less. Measured on generated
assemblies (`python -m benchmarks.grasp_error`)."""
_LEAST = np.array([*np.full(3, 1e-5), *np.full(3, np.radians(0.005))])
"""Error of a robot without errors, which its servos leave, (6,), 1 sigma, [m, rad]."""
_LEVEL = 0.5
"""A face carries weight if the vertical component of its normal is at least this."""
_FAR_M = 0.01
"""Standard deviation of a distance that weight closes in any case, far above all errors."""
_STEP = 1e-6
"""Step of the derivatives of placements by operations, [m, rad]."""


def state_relative_error(
    robot_error: str, plan: Plan, scene: Scene, moves: Sequence[Move], k: int, grip: Grip, joint: Array
) -> Array:
    """Return the covariance of the error of the held part relative to its hole, (6, 6), [m, rad], world axes.

    It is that where the guarded motion begins: of the shift of the front of the part, and of its rotation.

    Args:
        robot_error: What the robot assumes, as in `parse_robot_error`.
        moves: The moves of the plan.
        k: The operation, counted from 0.
        grip: The grip with which its part is held.
        joint: Covariance of the body twists of all planned poses, (6 n, 6 n), [m, rad].
    """
    last = max(i for i, move in enumerate(moves) if move.step.operation == k and not move.step.undo)
    t = moves[last].transfer
    begin = translate(t.T_world_goal, t.into.direction, -t.begins)
    t = replace(t, T_world_goal=begin, grips=(grip,))
    of_robot = _propagate(robot_error, plan, scene, [*moves[:last], Move(moves[last].step, t)])
    of_plan = _differentiate_placements(plan, k)
    contacts = plan.assembly.operations[k].contacts
    pairs = sorted({(contact.manipulated.part, contact.environment.part) for contact in contacts})
    B, A = (np.mean([of[part] - of[other] for part, other in pairs], axis=0) for of in (of_robot, of_plan))
    front = pose.apply(begin, t.foremost[None])[0]
    to_front = np.block([[np.eye(3), -pose.hat(front)], [np.zeros((3, 3)), np.eye(3)]])
    return np.asarray(to_front @ (B @ B.T + A @ joint @ A.T) @ to_front.T + np.diag(_LEAST**2))


def correlate_plan(observation: Observation, poses: Array, exact: bool) -> Array:
    """Return the covariance of the body twists of all planned poses, (6 n, 6 n), [m, rad].

    Args:
        observation: The observation that was corrected.
        poses: The planned poses, (n, 4, 4).
        exact: Whether the poses fulfil the contact equations, which then hold in their errors too.
    """
    C = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    if not exact:
        return C
    J = build_contact_equations(observation.assembly, observation.start, poses).linearise(poses)[1]
    CJ = C @ J.T
    return np.asarray(C - CJ @ np.linalg.pinv(J @ CJ, rcond=1e-9, hermitian=True) @ CJ.T)


def _propagate(robot_error: str, plan: Plan, scene: Scene, moves: Sequence[Move]) -> dict[str, Array]:
    """Return the errors of all parts once the last move has brought its part, (6, c) each, as columns of 1 sigma."""
    n = len(plan.assembly)
    none = RobotError(np.eye(4), np.zeros(len(scene.arm.joints)), np.eye(4), np.tile(np.eye(4), (n, 1, 1)))
    units = list_unit_errors(robot_error, scene)
    # A robot without errors, one for each error, and for each operation six for its grasp and six for its fits.
    error = stack_errors([none, *units, *[none] * (12 * n)])
    resting = plan.start
    for move in moves:
        k = move.step.operation
        first = 1 + len(units) + 12 * k
        before = twist_in_open_hand(scene, move.transfer, error, resting[move.transfer.part])
        pushed = np.linalg.norm((before - before[0])[: 1 + len(units), 0])
        dragged = pushed * _DRAGGED / [1.0, 1.0, 1.0, 1.0, move.transfer.weight_n, 1.0]
        error.in_hand[k, first : first + 6] = pose.exp(np.diag(dragged))
        put = bring(scene, move, error, KEPT * before)
        now = compute_transferred_poses(plan.assembly.operations[k], put, resting)
        if move is moves[-1]:
            return {part: _compare(T, len(put)) for part, T in now.items()}
        if not move.step.undo:
            put = put @ pose.exp(_enter_fits(plan, scene, k, now, first + 6).T)
        resting = place_part(plan, scene, move, error, put, resting, KEPT)
    raise AssertionError("a plan has moves")


def _compare(T: Array, r: int) -> Array:
    """Return the poses of a part by r robots less that by the first one, (6, r), as twists along world axes."""
    T = np.broadcast_to(T, (r, 4, 4))
    return np.asarray(pose.log(T @ pose.inverse(T[0])).T)


def _enter_fits(plan: Plan, scene: Scene, k: int, now: Poses, first: int) -> Array:
    """Return the body twists by which faces that fit into one another displace the part of an operation, (6, r).

    An error across a fit is left as far as its play allows: with the covariance S of the residuals y of the contact
    equations and R of their play, G = S (S + R)^-1 of y is taken away, and an error of covariance G R G^T is added.
    Weight closes contacts with the floor of a fit, so that a part sinks by its play whatever y is.

    Args:
        k: The operation.
        now: All parts where robots release the part, (r, 4, 4) each.
        first: The first of six robots that get the added error.
    """
    assembly = project_round_faces(plan.assembly)
    relations = assembly.relations()
    fits = np.array(
        [each.made == k and is_insertion(plan.assembly, assembly.given(each.contact)) for each in relations]
    )
    put = now[assembly.operations[k].main]
    if not fits.any():
        return np.zeros((6, len(put)))
    contacts = [each.contact for each, fit in zip(relations, fits, strict=True) if fit]
    equations = build_contact_equations(assembly, plan.start, plan.target_poses).among(fits)
    J = equations.linearise(plan.target_poses)[1][:, 6 * k : 6 * k + 6]
    to_body = pose.adjoint(pose.inverse(put[0]))
    off = [_compare(now[m.part], len(put)) - _compare(now[e.part], len(put)) for m, e in contacts]
    y = np.einsum("mi,mir->mr", J @ to_body, np.array(off)[equations.contact])
    plays = np.array([assembly.play(contact, 1e-3 * scene.clearance_mm) for contact in contacts])
    play = plays[equations.contact]
    upward = J[:, :3] @ put[0, 2, :3]
    pressed = np.abs(upward) > _LEVEL
    R = np.diag(np.where(pressed, 0.0, play**2 / 3.0))  # of a uniform distribution
    S = y @ y.T + np.diag(np.where(pressed, _FAR_M**2, 0.0))
    G = np.linalg.pinv(J) @ S @ np.linalg.pinv(S + R, hermitian=True)
    moved = -G @ y
    sinks = G @ np.where(pressed, play * upward, 0.0)
    U, sizes, _ = np.linalg.svd(np.column_stack([G @ np.sqrt(R), sinks]), full_matrices=False)
    moved[:, first : first + len(sizes)] += U * sizes
    return np.asarray(moved)


def _differentiate_placements(plan: Plan, k: int) -> dict[str, Array]:
    """Return the derivative of the error of each part after operation k by the body twists of all poses, (6, 6 n)."""
    usual = compute_placements(plan.assembly, plan.start, plan.target_poses)[k]
    found: dict[str, Array] = {part: np.zeros((6, 6 * len(plan.target_poses))) for part in usual}
    for i in range(k + 1):
        for j, twist in enumerate(_STEP * np.eye(6)):
            poses = np.array(plan.target_poses)
            poses[i] = poses[i] @ pose.exp(twist)
            for part, T in compute_placements(plan.assembly, plan.start, poses)[k].items():
                found[part][:, 6 * i + j] = pose.log(T @ pose.inverse(usual[part])) / _STEP
    return found
