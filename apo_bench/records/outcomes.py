"""Stages and codes of the outcomes of trials, with a sentence for each code.

A physical failure is a result, not an exception. `{part}` and `{operation}` (counted from 1) are filled in when the
outcome is made.
"""

from types import MappingProxyType

STAGES = (
    *("demonstrate", "observe", "correct", "predicted-success", "plan", "touch", "pick", "lift", "carry", "attach"),
    *("release", "depart", "judge", "worker"),
)
"""Stages at which a trial can fail, in order; `worker` is the process that runs it. A success ends at `done`."""

CODES = MappingProxyType(
    {
        "ok": "every operation was carried out",
        # demonstrate
        "demonstration_failed": "the human's own assembly was not right at the end",
        # observe
        "not_seen": "operation {operation} was not seen",
        # correct
        "inconsistent": "the contacts cannot all hold near what was seen: a gap above the threshold is left",
        "doubtful": "a relation is probably wrong",
        "not_converged": "the solver did not come to rest within its iterations",
        "not_finite": "the correction holds a number that is not finite",
        "raised": "the corrector raised an error or returned what it must not",
        # predicted-success
        "abstained": "the predicted success is too low",
        # plan
        "unreachable": "the arm cannot reach the goal of operation {operation} ({part})",
        "unreachable_start": "the arm cannot reach {part} where operation {operation} picks it up",
        "unstable_goal": "at the goal of operation {operation} the centre of mass of {part} lies beside its support",
        # touch .. depart
        "lost_grasp": "{part} was lost from the gripper in operation {operation}",
        "force_stop": "the motion of operation {operation} ({part}) was stopped by contact force before its goal",
        "collision": "the arm struck {part} in operation {operation}",
        "unstable_simulation": "the simulation became unstable in operation {operation}",
        # judge
        "not_made": "a contact of an operation was never made, because the operation was not finished",
        "gap": "faces that should touch are too far apart or too deep",
        "overlap": "faces that should touch overlap too little",
        "penetration": "parts are inside each other",
        "pushed": "a part that was already in place was pushed away",
        "not_released": "a part is still held",
        "not_at_rest": "a part still moves",
        # worker: of trials in a process of their own, whatever they were doing
        "worker_died": "the process that ran the trial died",
        "time_limit": "the trial took longer than its limit",
    }
)

_TOUCHING = MappingProxyType(
    {
        "collision": "the arm struck {part} while it touched what is fixed, before the first operation",
        "unreachable": "the arm cannot reach a place where it would touch what is fixed",
        "unstable_simulation": "the simulation became unstable while the arm touched what is fixed",
    }
)
"""Sentences of these codes for a robot that probes, before its first operation."""


def describe_touch(code: str, *, part: str = "") -> str:
    """Return the sentence of a code of the stage `touch`, which belongs to no operation."""
    return _TOUCHING[code].format(part=part)


def describe_outcome(code: str, *, part: str = "", operation: int = 0) -> str:
    """Return the sentence of a code; `operation` counts from 0."""
    return CODES[code].format(part=part, operation=operation + 1)
