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
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.wrist import BANDWIDTH_HZ, WristSensor, hand_load
from apo_bench.simulation.scene import switch_wrist_sensors_on

ZERO_S = 0.5
"""So long a wrist is zeroed: the mean of 500 readings has 0.045 times the noise of one."""
_SETTLE_S = 0.06
"""A low pass has forgotten its first reading but for 0.25 % then."""
_FAR_M = 0.0005  # shifted farther than this, how the joints turn is computed again
_FAR_RAD = 0.0025  # or turned by more than this


def servo(robot: Robot, law: Callable[[Sequence[float]], Array | None]) -> None:
    """Shift the tip a little, step by step, by the force on the part in the hand.

    Args:
        law: Called with the force, (3,) world, [N], before each physics step; returns how far the tip moves off
            where it began, (3,) world, [m], or None to end.

    Raises:
        ExecutionAborted: Something went wrong on the way.
    """
    q = robot.q
    offset = np.zeros(3)
    turns = robot.scene.kinematics.inverse_jacobian(q)[:, :3] @ robot.T[:3, :3].T
    force: Sequence[float] = robot.forces.net()
    passed = 0
    while (wanted := law(force)) is not None:
        offset = wanted
        passed += 1
        force = robot.servo_step(q + turns @ offset, passed)
    robot.q = q + turns @ offset
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


def zero(robot: Robot, wrist: WristSensor) -> None:
    """Stand still in free air; what the sensor shows on average, but for the known weights, is nothing from now on.

    Raises:
        ExecutionAborted: Something went wrong meanwhile.
    """
    with read_wrist(robot, wrist):
        robot.stand()
        wrist.start_zero()
        robot.wait(ZERO_S)
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
        ExecutionAborted: Something went wrong on the way.
    """
    with read_wrist(robot, wrist):
        q = robot.q
        offset = np.zeros(6)
        checked = offset
        J = _joint_turns(robot, q, about)
        passed = 0
        while (wanted := law(wrist.wrench(about + offset[:3]))) is not None:
            q = q + J @ (wanted - offset)
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
    """How the joints turn, (joints, 6), with the shift of a point, [m], and a turn about it, [rad], world."""
    T = robot.scene.kinematics.forward(q)
    # The tip turns with the point and moves by the shift plus w x (tip - point); both in the frame of the tip.
    R = T[:3, :3].T
    twist = np.block([[R, -R @ pose.hat(T[:3, 3] - about)], [np.zeros((3, 3)), R]])
    return np.asarray(robot.scene.kinematics.inverse_jacobian(q) @ twist)
