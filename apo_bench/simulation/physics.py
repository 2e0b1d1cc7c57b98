"""Physics settings of all simulations, with the reason for each value.

Time step and contact stiffness decide verdicts at the limit of the clearance, so they belong together: the time
constant of a contact is four steps, its damping ratio 2. With a ratio of 1 a stick in some perfect assemblies rocks in
its slot forever at 1 to 5 mm/s, with 1.5 still in 3 of 100. With a time constant of two steps a misaligned stick
rattles over an edge that should stop it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, final

import mujoco

from apo_bench.errors import require


@final
@dataclass(frozen=True)
class Physics:
    """MuJoCo options shared by the demonstration and the replay."""

    timestep_s: float = 0.001
    solref: tuple[float, float] = (0.004, 2.0)
    """Time constant [s] and damping ratio of a contact."""
    solimp: tuple[float, float, float, float, float] = (0.99, 0.999, 0.001, 0.5, 2.0)
    """A soft impedance lets a grasp creep; 0.99 to 0.999 holds it to some micrometres a second."""
    impratio: float = 100.0
    """Stiff friction: without it a stick held off its centre turns in the hand by degrees a second."""
    condim: int = 3
    """Between parts: sliding friction only, since corners resist rotation anyway. Gripper pads set torsional friction
    themselves."""
    tolerance: float = 1e-10
    iterations: int = 50


def physics(timestep_s: float = 0.001) -> Physics:
    """The settings for a time step; the time constant of contacts is four steps.

    Raises:
        InputError: A time step for which the settings were not checked.
    """
    require(
        0.0001 <= timestep_s <= 0.001,
        f"a time step of {timestep_s * 1e3:g} ms was given; 0.1 to 1 ms are allowed, "
        "since a longer step lets misaligned parts slip into each other; use 1 (tables) or 0.5 (check).",
    )
    return Physics(timestep_s=timestep_s, solref=(4 * timestep_s, 2.0))


def set_options(option: Any, s: Physics) -> None:
    """Set these options in a model (`MjSpec.option`) before it is compiled."""
    option.timestep = s.timestep_s
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = s.impratio
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.tolerance = s.tolerance
    option.iterations = s.iterations


def set_contact(geoms: Iterable[Any], s: Physics) -> None:
    """Set stiffness and damping of contacts for geoms of an `MjSpec`."""
    for geom in geoms:
        geom.solref[:2] = s.solref
        geom.solimp = s.solimp
