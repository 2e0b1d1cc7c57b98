"""Names and design of the golden data: which items there are, and what the package calls what they name.

Items have names of their own, so that recorded data outlives a rename: after one, change `SETTINGS`, `VALUES`,
`EXPORTS` or `KEYS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

SETTINGS: dict[str, str] = {}
"""Settings of trials, arguments of environments and columns of records: neutral name -> name today."""
VALUES = {"shifted:3": "face-offset:3mm", "shifted:5": "face-offset:5mm", "promise": "predicted-success"}
"""Values of settings, and correctors."""
EXPORTS: dict[str, str] = {}
"""What `apo_bench` exports."""
KEYS = {
    "extra_operations": "extra_steps",
    "test_passes": "consistent",
    "dropped": "dropped_contacts",
    "seen_again": "reobservations",
    "wrong_relation": "wrong_contact",
    "touches_refused": "probe_contacts_rejected",
    "felt_mm": "base_error_estimate_mm",
    "felt_deg": "base_error_estimate_deg",
    "felt_sure_mm": "base_error_estimate_std_mm",
    "felt_sure_deg": "base_error_estimate_std_deg",
    "contacts_right": "contacts_true_positive",
    "contacts_missed": "contacts_false_negative",
    "contacts_false": "contacts_false_positive",
    "free_moved": "fit_adjustments",
    "moved_in_hand": "grasp_slip",
    "pushed_mm": "placed_part_shift_mm",
    "sim_seconds": "sim_time_s",
    "chi_square_freedom": "chi_square_dof",
    "freed": "corrected_operations",
    "tried": "tried_corrections",
    "left_out": "rejected_observations",
    "predicted": "failure_prediction",
    "touches": "probe_contacts",
    "targets": "step_poses",
    "most": "largest_distance",
    "human_covariance": "human_error_covariance",
}
"""Attributes, columns of records, keys of observations and of `info`."""
DROPPED = {
    *("schema", "env_id", "config_hash", "scenario", "noise_level", "noise_mm", "noise_deg", "human_error_scale"),
    "clearance_mm",
    *("pose_source", "noise", "grasp", "arm", "robot_error", "contact_source", "method", "max_reobservations"),
    *("ft_sensor", "assumed_robot_error", "min_predicted_success", "seed", "secret_seed", "timestep_s", "fidelity"),
    *("human_error_covariance", "level", "sentence", "joint_control", "why", "trace", "assembly"),
    *("assumed", "believed"),
}
"""Not kept of what the package returns, by neutral names: settings, texts, provenance, iterations of solvers."""

SHIPPED = (
    *("block_on_block", "bridge_cycle", "carried_bridge", "dovetail", "fixture_alignment", "gearbox"),
    *("l_bracket_on_plate", "nested_bushings", "peg_in_hole", "pocket_table", "shaft_through_brackets"),
    *("stick_in_tower", "stick_on_castles", "vanished_fixture", "wedge_under_roof"),
)
_FAMILIES = [
    "corners",
    "pegs",
    "posts",
    "covers",
    "carried",
    "pinned",
    "bridges",
    "keys",
    "grooves",
    "mixed",
    "castles",
    "rods",
]
GENERATED = (
    *(f"generated:{family}:0" for family in _FAMILIES),
    *(
        f"generated:{family}:1"
        for family in ("corners", "pegs", "covers", "bridges", "keys", "grooves", "mixed", "rods")
    ),
)
SCENARIOS = (*SHIPPED, *GENERATED)
LEVELS = (1.0, 2.0, 0.5)
"""Noise of seeds 0, 1 and 2 [mm and degrees]."""
CORRECTORS = (
    "snap",
    "paper",
    "paper-track",
    "contact",
    "contact-robust",
    "contact-drop",
    "least-squares",
)
METHODS = ("uncorrected", "nominal", "snap", "paper", "paper-track", "contact", "contact-robust", "oracle")
NOISES = (
    *("heavy-tailed", "outliers", "bias-view", "correlated", "symmetric", "camera", "anisotropic", "per-part"),
    *("flips", "stale", "swaps", "rays", "displaced-view"),
)
_ALL_ERRORS = "robot_error=hand_eye:0.5/0.1+joints:0.02+tool:0.2+in_hand:0.2/0.5"
OPTIONS = (
    "method=contact+probe robot_error=hand_eye:0.5/0.1",
    "method=contact-robust pose_source=depth-camera",
    "method=contact+spiral noise_mm=3",
    f"method=contact-robust {_ALL_ERRORS}",
    "method=contact contact_source=detected",
    f"method=uncorrected+probe {_ALL_ERRORS} fidelity=near-contact",
    "method=uncorrected pose_source=depth-camera",
    "method=uncorrected+spiral",
    "method=oracle robot_error=hand_eye:1/0.2",
    "method=paper contact_source=false-negative",
    "method=contact noise=heavy-tailed",
    f"method=contact-robust+probe {_ALL_ERRORS} ft_sensor=joint-torque assumed_robot_error=unknown",
    "method=contact pose_source=depth-camera noise_mm=0.5 fidelity=near-contact",
    "method=snap+spiral robot_error=in_hand:0.5/1 fidelity=near-contact",
    "method=contact-robust contact_source=false-positive",
    "method=contact-robust noise=outliers max_reobservations=2",
    "method=contact grasp=weld",
    "method=contact arm=ur5e_primitive",
    "method=oracle+probe robot_error=tool:0.5 ft_sensor=ideal fidelity=near-contact",
    "method=least-squares noise=correlated",
    "method=contact-robust contact_source=shifted:3",
    "method=contact-drop contact_source=shifted:5",
    "method=contact noise_mm=4 noise_deg=4 min_predicted_success=0.9",
    "method=contact-robust noise=flips:p=0.2/r=0.5 max_reobservations=1",
    "method=paper robot_error=joints:0.05 fidelity=near-contact",
    "method=penalty noise=camera",
    "method=contact arm=panda_primitive fidelity=near-contact",
    "method=contact human_error_scale=0 noise_mm=0 noise_deg=0",
    "method=contact-robust contact_source=detected-jointly fidelity=near-contact",
    "method=contact-robust noise=bias-view",
    "method=physics-settle fidelity=near-contact",
    "method=contact clearance_mm=0.1",
    "method=last-only",
    "method=no-history noise=symmetric",
    "method=minimal fidelity=near-contact",
)
ENVIRONMENTS = ("APOReplay-v0", "APOTrack-v0", "APOInsert-v0")


class Item(NamedTuple):
    """One thing to compute."""

    kind: str
    scenario: str
    seed: int
    case: str
    """Of a trial its settings, `key=value` by neutral names; of others a corrector or an environment."""
    small: bool
    """Whether it belongs to the subset `small`."""

    @property
    def name(self) -> str:
        return f"{self.kind} {self.scenario} seed={self.seed} {self.case}".strip()


def design() -> Iterator[Item]:
    """All items, scenario by scenario."""
    turn = 0
    for i, scenario in enumerate(SCENARIOS):
        shipped = scenario in SHIPPED
        for seed in range(3):
            small = seed == i % 3
            corrected = small and (shipped or i % 4 == 0)
            carried_out = small and shipped and scenario != "gearbox"  # whose trials take longest
            for kind in ("observation", "detection"):
                yield Item(kind, scenario, seed, "", corrected)
            for corrector in CORRECTORS:
                yield Item("correction", scenario, seed, corrector, corrected)
            for k, method in enumerate(METHODS):
                fidelity = ("full", "near-contact")[(i + k + seed) % 2]
                case = f"method={method} fidelity={fidelity}"
                yield Item("trial", scenario, seed, case, carried_out and k % 4 == i % 4)
            for k in range(2 if shipped else 1):
                yield Item("trial", scenario, seed, OPTIONS[turn % len(OPTIONS)], carried_out and k == 0)
                turn += 1
        for environment in ENVIRONMENTS:
            yield Item("episode", scenario, i % 3, environment, scenario in SHIPPED[1::5])


def today(name: str, names: Mapping[str, str]) -> str:
    """What the package calls something today; of several names joined by `+`, each."""
    return "+".join(names.get(part, part) for part in name.split("+"))


def neutral(name: str) -> str:
    """The neutral name of a setting, column, attribute or key."""
    return _NEUTRAL.get(name, name)


def neutral_value(text: str) -> str:
    """The neutral form of a word in a result."""
    return _NEUTRAL_VALUES.get(text, text)


_NEUTRAL_VALUES = {now: name for name, now in VALUES.items()}
_NEUTRAL = {now: name for name, now in (KEYS | SETTINGS).items() if name != "human_covariance"}
