"""Physics steps of a motion whose command depends on the force after each step, with little work between them.

A step sets the command, simulates, and returns the force. What the force filters, the wrist sensor and the checks of
the robot need is kept, and done once a tick for all of its steps.
"""

from collections.abc import Generator
from typing import final

import mujoco
import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.wrist import WristSensor
from apo_bench.simulation.scene import WRIST_SENSORS, compute_only


@final
class ForceSteps:
    """The physics steps of one robot that holds a part, with its wrist sensor."""

    def __init__(self, robot: Robot, wrist: WristSensor, axes: Array) -> None:
        """Begin with no step.

        Args:
            wrist: A sensor that is switched on and reads at each step.
            axes: The axes along which forces are returned, (3, 3) columns, world.
        """
        self._robot = robot
        self._wrist = wrist
        self._net = robot.forces.net_along(axes)
        self._contacts = robot.forces.sensors
        self._sensors = [*robot.forces.needed, *(robot.model.sensor(name).id for name in WRIST_SENSORS)]
        self._rows = np.empty((robot.steps_of_tick, len(self._contacts)))
        self._wrenches = np.empty((robot.steps_of_tick, 6))
        self._taken = 0  # steps in the present tick
        self.force: list[float] = (self._net @ self._contacts).tolist()
        """The contact force on the held parts after the last step, along the axes, [N]."""

    def ticks(self, steps: int) -> Generator[int, None, None]:
        """Yield how many steps to take until the next tick is complete, or all are taken, and then check the robot.

        Raises:
            ExecutionAborted: The simulation diverged, or the arm collided.
        """
        robot = self._robot
        while steps:
            count = min(steps, robot.steps_of_tick - self._taken)
            begin = self._taken
            with compute_only(robot.model, robot.data, self._sensors):
                yield count
            taken = slice(begin, begin + count)
            robot.forces.take(self._rows[taken], robot.step_s)
            self._wrist.take_rows(self._wrenches[taken], robot.step_s)
            steps -= count
            if self._taken == robot.steps_of_tick:
                self._taken = 0
                robot.check_state()

    def step(self, q: Array, velocity: Array) -> list[float]:
        """Take one physics step; return the contact force on the held parts along the axes, [N].

        Args:
            q: Commanded joint angles, (joints,), [rad].
            velocity: Joint velocities for the feedforward, (joints,), [rad/s].
        """
        robot = self._robot
        robot.command(q, velocity)
        mujoco.mj_step(robot.model, robot.data)
        self._rows[self._taken] = self._contacts
        self._wrenches[self._taken] = self._wrist.raw
        self._taken += 1
        self.force = self._net.dot(self._contacts).tolist()
        return self.force
