"""The corrector `paper`: the method of Suehiro and Ikeuchi, on all operations after the demonstration (Section 3.3)."""

from apo_bench.assembly import Correction, Observation, build_contact_equations, find_largest_residual
from apo_bench.correction.baselines.candidates import candidates
from apo_bench.correction.baselines.own_contacts import solve_own_contacts
from apo_bench.correction.checks.status import refuse_correction, solver_status, status_sentence
from apo_bench.correction.solvers import solve_newton


def paper(observation: Observation) -> Correction:
    """Solve for the motion parameters that Section 3.3.2 chooses, then each other pose for its own contacts.

    Returns:
        `converged` if every |e| is within `observation.gap_m`; otherwise `not_seen` (nothing was changed),
        `inconsistent`, `not_converged` or `not_finite` (nothing was changed), with its sentence. `freed` are the
        candidates; rank and trace are those of their joint solution.
    """
    if not observation.observed.all():
        return refuse_correction(observation)
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)
    before = system.gaps(observation.poses)
    freed = candidates(observation.assembly, ~(before <= observation.gap_m))
    solution = solve_newton(system.among(system.contacts_with(freed)), observation.poses, freed)
    status = solver_status(solution, find_largest_residual(system.gaps(solution.poses)), observation.gap_m)
    poses = solution.poses
    if status == "converged":
        for k in sorted(set(range(len(poses))).difference(freed)):
            poses = solve_own_contacts(system, poses, k, observation.gap_m)
    return Correction(
        poses=poses,
        status=status,
        sentence=status_sentence(status, observation.gap_m),
        freed=freed,
        gap_before_m=find_largest_residual(before),
        gap_after_m=find_largest_residual(system.gaps(poses)),
        rank=solution.rank,
        trace=solution.trace,
    )
