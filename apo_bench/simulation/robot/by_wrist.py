"""Force-controlled motions: servoing on the force on the held part, pressing and complying by the wrist sensor.

While the wrist sensor reads, every physics step is simulated, at either fidelity.
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
"""Duration of zeroing: the mean of 500 readings has 0.045 times the noise of one."""
_SETTLE_S = 0.06
"""Time after which 0.25 % of the first reading is left in the low pass."""
_FAR_M = 0.0005  # shift of the hand after which `comply` computes the Jacobian again
_FAR_RAD = 0.0025  # turn of the hand after which `comply` computes the Jacobian again


def servo(robot: Robot, law: Callable[[Sequence[float]], Array | None]) -> None:
    """Shift the tip, physics step by physics step, by a control law on the contact force on the held part.

    Args:
        law: Called with the force, (3,), world, [N], before each step. Returns the displacement of the tip from where
            it began, (3,), world, [m], or None to end.

    Raises:
        ExecutionAborted: Something went wrong on the way.
    """
    q = robot.q
    offset = np.zeros(3)
    # The displacement is small, so one Jacobian maps it to the joints: (joints, 3), per metre along world axes.
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
    """Return a new wrist sensor of a robot.

    Args:
        name: Name of its noise, or its standard deviations, as in `parse_ft_noise`.
        rng: Source of its offset and noise.
        bandwidth_hz: Cutoff frequency of its low pass.

    Raises:
        InputError: An unknown name, or a number that is not allowed.
    """
    noise = parse_ft_noise(name)
    return WristSensor(robot.scene, robot.data.sensordata, robot.encoders, noise, rng, bandwidth_hz, robot.ft_drift)


@contextmanager
def read_wrist(robot: Robot, wrist: WristSensor) -> Iterator[None]:
    """Within this context the wrist sensor reads every step, and guards act on its force, at full fidelity.

    The robot stands still at first until the low pass has settled. Nested contexts of the same sensor do nothing.
    """
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
    """Tare the wrist sensor while the arm stands still in free air.

    Raises:
        ExecutionAborted: Something went wrong meanwhile.
    """
    with read_wrist(robot, wrist):
        robot.stand()
        wrist.start_zero()
        robot.wait(ZERO_S)
        wrist.end_zero()


def zero_again(robot: Robot, wrist: WristSensor) -> None:
    """Tare the wrist sensor before a guarded motion if it has ever drifted; the arm stands still in free air.

    Raises:
        ExecutionAborted: Something went wrong meanwhile.
    """
    with read_wrist(robot, wrist):
        wrist.drifts = wrist.drifts or wrist.is_off
        if wrist.drifts:
            zero(robot, wrist)


def press(robot: Robot, line: Trajectory, direction: Array, newton: float, wrist: WristSensor) -> float | None:
    """Follow a line until the filtered force against `direction` exceeds `newton`, and stop there at once.

    The arm moves on while the sensor lags behind by its time constant. At 2 mm/s the impact of a first touch stays
    below the collision limit of 20 N, also with half the time step. The tip then stops within 0.03 mm of the touch. At
    4 mm/s this holds with the usual step only, at 10 mm/s not at all.

    Args:
        direction: The direction of pressing, a unit vector, (3,), world.
        newton: The force limit, [N]; at least 5 times `wrist.sigma[0]`, or noise stops the motion.

    Returns:
        What is left of the line, [m], with the robot where its encoders say (`robot.T`). None if the robot followed it
        to its end without contact.

    Raises:
        ExecutionAborted: The line leaves the arm's reach, or something went wrong on the way.
    """
    with read_wrist(robot, wrist):
        return robot.follow(line, Guard(direction, newton)) or None  # 0.0: the guard did not stop it


def comply(robot: Robot, law: Callable[[Array], Array | None], about: Array, wrist: WristSensor) -> None:
    """Move the hand, reading by reading, by a control law on the wrench: `servo` in six degrees of freedom.

    Args:
        law: Called at each reading (`READING_S`) with the filtered wrench about the present reference point, (6,), [N]
            and [Nm], world. Returns the displacement of the hand from where it began, (6,), or None to end: the shift
            of the point, [m], and a rotation vector about it, [rad], world.
        about: The reference point at the beginning, (3,), world, [m]; it moves with the hand.

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
            while not taken:  # physics steps until the next reading is complete
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
    """Return the matrix, (joints, 6), from shift of a point, [m], and turn about it, [rad], world, to joint angles."""
    T = robot.scene.kinematics.forward(q)
    # The tip turns with the point and moves by the shift plus w x (tip - point); both in the frame of the tip.
    R = T[:3, :3].T
    twist = np.block([[R, -R @ pose.hat(T[:3, 3] - about)], [np.zeros((3, 3)), R]])
    return np.asarray(robot.scene.kinematics.inverse_jacobian(q) @ twist)
