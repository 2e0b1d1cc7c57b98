"""Motions that depend on force: on the part in the hand, or by the sensor at the wrist.

Nothing is left out while the sensor reads: these motions are simulated in full at either fidelity.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.records import parse_ft_noise
from apo_bench.simulation.robot.forces import Guard
from apo_bench.simulation.robot.paths import Trajectory, translate
from apo_bench.simulation.robot.reach import joint_gradients
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.wrist import BANDWIDTH_HZ, WristSensor, hand_load
from apo_bench.simulation.scene import switch_wrist_sensors_on

ZERO_S = 0.5
"""So long a wrist is zeroed: the mean of 500 readings has 0.045 times the noise of one."""
_SETTLE_S = 0.06
"""A low pass has forgotten its first reading but for 0.25 % then."""
_SHIFT_M = 0.001  # shift of the tip by which the joint gradients are computed
_TURN_RAD = 0.002  # turn of the tip by which they are computed
_FAR_M = 0.0005  # shifted farther than this, they are computed again
_FAR_RAD = 0.0025  # or turned by more than this


def servo(robot: Robot, law: Callable[[Sequence[float]], Array | None]) -> None:
    """Shift the tip a little, step by step, by the force on the part in the hand.

    Args:
        law: Called with the force, (3,) world, [N], before each physics step; returns how far the tip moves off
            where it began, (3,) world, [m], or None to end.

    Raises:
        ExecutionAborted: The arm does not reach around there, or something went wrong on the way.
    """
    q = robot.q
    offset = np.zeros(3)
    ends = [(translate(robot.T, axis, -_SHIFT_M), translate(robot.T, axis, _SHIFT_M)) for axis in np.eye(3)]
    J_inverse = robot.reached(joint_gradients(robot.scene.kinematics, ends, q, _SHIFT_M))
    force: Sequence[float] = robot.forces.net()
    passed = 0
    while (wanted := law(force)) is not None:
        offset = wanted
        passed += 1
        force = robot.servo_step(q + offset @ J_inverse, passed)
    robot.q = q + offset @ J_inverse
    robot.T = translate(robot.T, offset, 1.0)


def get_wrist(robot: Robot, name: str, rng: np.random.Generator, bandwidth_hz: float = BANDWIDTH_HZ) -> WristSensor:
    """The sensor of a robot, by the name of its noise.

    Raises:
        InputError: An unknown name, or a number that is not allowed.
    """
    return WristSensor(robot.scene, robot.data.sensordata, robot.encoders, parse_ft_noise(name), rng, bandwidth_hz)


@contextmanager
def read_wrist(robot: Robot, wrist: WristSensor) -> Iterator[None]:
    """The wrist reads at every step, and guards of motions are its; what the robot does here stands still at first."""
    if robot.wrist is wrist:
        yield
        return
    before = robot.wrist, robot.fidelity
    robot.wrist, robot.fidelity = wrist, "full"
    wrist.begin(hand_load(robot.scene.kinematics, robot.opening()))
    try:
        with switch_wrist_sensors_on(robot.model):
            robot.wait(_SETTLE_S)
            yield
    finally:
        robot.wrist, robot.fidelity = before


def zero(robot: Robot, wrist: WristSensor, seconds: float = ZERO_S) -> None:
    """Stand still in free air; what the sensor shows on average, but for the known weights, is nothing from now on.

    Raises:
        ExecutionAborted: Something went wrong meanwhile.
    """
    with read_wrist(robot, wrist):
        robot.stand()
        wrist.start_zero()
        robot.wait(seconds)
        wrist.end_zero()


def press(robot: Robot, line: Trajectory, direction: Array, newton: float, wrist: WristSensor) -> float | None:
    """Follow a line until the filtered force against `way` passes `newton`, and stop there at once.

    The arm goes on while the sensor lags behind by its time constant. At 2 mm/s the blow of a first touch stays below
    the limit of 20 N of a collision, with half the time step too, and the tip stops within 0.03 mm of where it touched;
    at 4 mm/s with the usual step only, at 10 mm/s not. `newton` should be 5 times `wrist.sigma` at least, or noise
    stops it.

    Args:
        direction: The direction of pressing, a unit vector, (3,), world.

    Returns:
        What is left of the line, [m], the robot being where its encoders say (`robot.T`); None if it was followed to
        its end, and nothing was met.

    Raises:
        ExecutionAborted: The line leaves the arm's reach, or something went wrong on the way.
    """
    with read_wrist(robot, wrist):
        return robot.follow(line, Guard(direction, newton)) or None


def comply(robot: Robot, law: Callable[[Array], Array | None], about: Array, wrist: WristSensor) -> None:
    """Move the hand a little, reading by reading, by the wrench: `servo` in six directions.

    Args:
        law: Called at each reading (`READING_S`) with the filtered wrench, (6,), [N] and [Nm], world, about the point
            where it is then; returns how far the hand moves off where it began, (6,): the shift of the point, [m],
            and a rotation vector about it, [rad], world; or None to end.
        about: The point, (3,), world, [m]; it moves with the hand.

    Raises:
        ExecutionAborted: The arm does not reach around there, or something went wrong on the way.
    """
    with read_wrist(robot, wrist):
        q = robot.q
        offset = np.zeros(6)
        checked = offset
        J = _joint_turns(robot, q, about)
        passed = 0
        while (wanted := law(wrist.wrench(about + offset[:3]))) is not None:
            q = q + (wanted - offset) @ J
            offset = np.array(wanted)
            taken = False
            while not taken:
                passed += 1
                robot.servo_step(q, passed)
                taken = wrist.take(robot.step_s)
            far = np.abs(offset - checked)
            if far[:3].max() > _FAR_M or far[3:].max() > _FAR_RAD:
                checked = offset
                J = _joint_turns(robot, q, about + offset[:3])
        robot.q = q
        robot.T = robot.scene.kinematics.forward(q)


def _joint_turns(robot: Robot, q: Array, about: Array) -> Array:
    """How the joints turn, (6, joints), per metre along each axis and per radian about each through a point."""
    T = robot.scene.kinematics.forward(q)
    to = pose.at(about)
    T_point_tip = pose.inverse(to) @ T
    turns = []
    for twists, by in ((np.eye(6)[:3], _SHIFT_M), (np.eye(6)[3:], _TURN_RAD)):
        ends = [(to @ pose.exp(-by * unit) @ T_point_tip, to @ pose.exp(by * unit) @ T_point_tip) for unit in twists]
        turns.append(robot.reached(joint_gradients(robot.scene.kinematics, ends, q, by)))
    return np.vstack(turns)
