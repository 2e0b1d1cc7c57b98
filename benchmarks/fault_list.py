"""Fifty small errors that the tests must notice, each of a kind that people make when they change this code.

They were chosen by reading the code, not the tests: a flipped sign, a wrong index, a dropped term, swapped operands, an
end of a range that is off by one, a missing check. None stops a module from being imported.
"""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One error in one file of the package."""

    file: str
    """Under `apo_bench`; its first folder is the room whose tests must notice."""
    before: str
    """Found exactly once in the file."""
    after: str
    what: str

    @property
    def room(self) -> str:
        return self.file.split("/")[0]


FAULTS = (
    Fault("geometry/pose.py", "- K / 2 + D * K @ K", "- K / 2 + K @ K", "the logarithm loses a factor"),
    Fault(
        "geometry/clearance.py",
        "box.center + (low - high) / 2",
        "box.center - (low - high) / 2",
        "a box with one fit side recedes to the wrong side",
    ),
    Fault("geometry/covering.py", "area / of.area)", "area / self.area)", "a share of the wrong overlap"),
    Fault("geometry/convex.py", "- u[..., k] * v", "+ u[..., k] * v", "a cross product of edges is none"),
    Fault("geometry/penetration.py", " and low_b[2] < high_a[2]", "", "what lies above is met on the way down"),
    Fault("geometry/swept.py", "return max(0.0, at - _SLACK_M)", "return max(0.0, at)", "the slack is kept"),
    Fault("geometry/symmetry.py", '"nij,mji->nm"', '"nij,mij->nm"', "a turn instead of its inverse"),
    Fault(
        "correction/solvers/linear_step.py",
        "twists(step, L[:, :, 3:])",
        "twists(step, L[:, :, :3])",
        "steps are shortened by their shift instead of their turn",
    ),
    Fault(
        "correction/solvers/inequalities.py",
        "plane[:, 3] -= np.where",
        "plane[:, 3] += np.where",
        "planes are shifted to the wrong side",
    ),
    Fault("correction/solvers/newton.py", "ca * sg + sa * sb * cg", "ca * sg - sa * sb * cg", "a wrong sign in Eq. 4"),
    Fault(
        "correction/region.py",
        "chdtri(free.shape[1], ",
        "chdtri(known.rank, ",
        "directions that are fixed for those that are free",
    ),
    Fault("correction/checks/status.py", "unit_m / sqrt(3.0)", "unit_m / sqrt(12.0)", "half the play instead of all"),
    Fault(
        "correction/relation_equations.py",
        "self.operations[i] if j > k})",
        "self.operations[i] if j >= k})",
        "one too many",
    ),
    Fault("correction/baselines/track.py", "in reversed(range(i, n))", "in range(i, n)", "undone in the wrong order"),
    Fault(
        "correction/baselines/penalty.py",
        "np.sqrt(v / (1 - _SQUARE**t))",
        "np.sqrt(v / (1 - _MEAN**t))",
        "Adam's memory of squares is corrected as that of means",
    ),
    Fault(
        "judging/contacts.py",
        "max(0.0, float(-e.min()))",
        "0.0",
        "faces that are inside each other have no gap",
    ),
    Fault("judging/verdict.py", "relation.lost <= k for", "relation.lost < k for", "no fixture is put away any more"),
    Fault("judging/verdict.py", "reached.area / true.area", "true.area / reached.area", "shares turned over"),
    Fault("judging/verdict.py", "put.pop(part, None)", "put.get(part)", "a part that is moved on is pushed"),
    Fault("judging/contacts.py", "np.degrees(snapshot.spin_rad_s)", "snapshot.spin_rad_s", "rad/s taken for deg/s"),
    Fault("judging/verdict.py", "or not self.demonstrated.holds)", "or self.demonstrated.holds)", "the wrong reason"),
    Fault(
        "sweeps/work/dispatch.py",
        "self._now - job.heard > STARTING_S",
        "self._now - job.heard > self._limit_s",
        "a worker that compiles has the limit of a trial",
    ),
    Fault("sweeps/work/dispatch.py", "min(now - self._looked, _LONGEST_TURN_S)", "now - self._looked", "sleep counts"),
    Fault(
        "sweeps/grid.py", "<= seed < grid.seed + grid.trials]", "<= seed <= grid.seed + grid.trials]", "one too many"
    ),
    Fault(
        "sweeps/work/worker.py", 'row["failure_stage"] == "worker"', "False", "a lost trial is judged by its time again"
    ),
    Fault("sweeps/progress.py", "(total - ended) / ended", "total / ended", "the time left does not fall"),
    Fault("assembly/topology.py", "Term(k), *inverted(before)", "Term(k), *before", "a carried part goes twice"),
    Fault(
        "observation/models/camera.py",
        "_stretch(sight, IN_IMAGE, OUT_OF_IMAGE)",
        "_stretch(sight, OUT_OF_IMAGE, IN_IMAGE)",
        "turns are worst about the line of sight",
    ),
    Fault("statistics/paired.py", "np.std(x, ddof=1)", "np.std(x)", "the spread of a sample is that of all"),
    Fault(
        "simulation/execution/search.py",
        "or side > push + self.guard.newton:",
        "or side < 0.0:",
        "a spiral goes on although walls hold the part",
    ),
    Fault("parts/faces.py", "float(grid[axis][k + forward])", "float(grid[axis][k])", "a face one layer too deep"),
    Fault("parts/faces.py", "return 1 - 2 * (self.side % 2)", "return 2 * (self.side % 2) - 1", "normals look inwards"),
    Fault("parts/stated.py", "inertia=1e-15 *", "inertia=1e-12 *", "inertia a thousand times too large"),
    Fault(
        "parts/stated.py", "v = v - (v @ axis) * axis", "v = v + (v @ axis) * axis", "a part along the axis is doubled"
    ),
    Fault("parts/load.py", "* float(face.normal @ face.outline[0])", "", "the divergence theorem without positions"),
    Fault(
        "parts/load.py",
        "abs(mark.point[surface.axis] - surface.height)",
        "(mark.point[surface.axis] - surface.height)",
        "a mark lies on every face above it",
    ),
    Fault("parts/load.py", "<= mass <= HEAVIEST_KG", "<= mass", "the heaviest part is not looked for"),
    Fault(
        "parts/making/body.py",
        "z1 = (high**2 - low**2) / 2.0",
        "z1 = (high - low) ** 2 / 2.0",
        "the moment of a prism as if it stood at zero",
    ),
    Fault(
        "parts/making/body.py",
        "np.pi * r**4 / 4.0",
        "np.pi * r**4 / 2.0",
        "the moment about the axis for one across it",
    ),
    Fault(
        "scenario/layout.py",
        "goals[shift.operation] @ pose.at(length * shift.axis)",
        "pose.at(length * shift.axis) @ goals[shift.operation]",
        "a shift in the frame of the world",
    ),
    Fault("scenario/layout.py", "lowered[2, 3] -= extent(", "lowered[2, 3] += extent(", "a smaller part hangs higher"),
    Fault("scenario/layout.py", "np.degrees(yaw_rad)", "yaw_rad", "radians taken for degrees"),
    Fault(
        "scenario/contacts.py",
        "return Gap(kind, 1e-3 * low, 1e-3 * high)",
        "return Gap(kind, low, high)",
        "mm taken for m",
    ),
    Fault(
        "scenario/contacts.py",
        "refuse_unless(b in there, below",
        "refuse_unless(True, below",
        "a contact with what is not there yet",
    ),
    Fault(
        "scenario/layout.py", "(low + high) / 2]", "(high - low) / 2]", "half the width of an interval for its middle"
    ),
    Fault(
        "scenario/layout.py",
        "return {part: T if part in",
        "return {part: T if part not in",
        "the wrong parts follow the site",
    ),
    Fault("scenario/scenario.py", "R.T @ _guided(", "R @ _guided(", "an error in the wrong frame"),
    Fault("scenario/scenario.py", "turn @ (before.get(", "(before.get(", "what is carried is not turned"),
    Fault(
        "scenario/order.py",
        "for k, operation in enumerate(assembly.operations):",
        "for k, operation in enumerate(assembly.operations[1:]):",
        "operations counted one off",
    ),
    Fault(
        "scenario/order.py",
        "not any(depth > TOUCH_M for depth in deep)",
        "not all(depth > TOUCH_M for depth in deep)",
        "a part must stand on all others",
    ),
)
