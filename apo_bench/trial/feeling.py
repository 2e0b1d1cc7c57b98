"""How the robot of a trial feels: what it believes of itself before it touches anything, and what its wrist is like."""

from apo_bench.assembly import Plan
from apo_bench.correction.touches import UNSTATED, believe, slip_sigmas
from apo_bench.records import USUAL_WRENCH, robot_sigmas
from apo_bench.simulation.execution.feel.feeling import ACTS, Feels
from apo_bench.simulation.scene.scene import Scene


def feels_of(
    plan: Plan,
    scene: Scene,
    stated: str | None,
    seed: tuple[int, ...],
    wrench: str = USUAL_WRENCH,
    acts: tuple[str, ...] = ACTS,
) -> Feels:
    """A robot that is told how wrong it may be, and finds out how wrong it is.

    Args:
        stated: Standard deviations of its errors, as in a row; None: nobody says, and what is usual is assumed.
        seed: Of the noise of the sensor at its wrist.
        wrench: That sensor, as in a row.
        acts: What it does besides.

    Raises:
        InputError: An unknown kind of error, or a number that is not allowed.
    """
    sigmas = UNSTATED if stated is None else robot_sigmas(stated)
    belief = believe(sigmas, len(scene.arm.joints), plan.goals[:, :3, 3].mean(axis=0))
    return Feels(belief, slip_sigmas(sigmas), seed, wrench, acts)
