"""The topology of an assembly, and the goals that flow over it, in the words of the paper. No solver, no simulator."""

from apo_bench.assembly.correction_record import Consistency, Correction, Iterate, Look, LookingCorrector, Suspect, Try
from apo_bench.assembly.equations import Equations, largest, largest_gap
from apo_bench.assembly.facing import face_gap, height, opposed
from apo_bench.assembly.facing_round import Facing, measure_round, round_pairs
from apo_bench.assembly.goals import (
    SCHEDULE_REMEDY,
    Demonstration,
    Layout,
    Observation,
    Plan,
    Poses,
    Step,
    goals_in_force,
    placements,
    schedule_fault,
)
from apo_bench.assembly.graph import Arc, ArcResiduals, Graph, Node, arc_residuals, observed_residuals, relation_graph
from apo_bench.assembly.joint_play import apart_limit_mm, deep_limit_mm, joint_play_mm
from apo_bench.assembly.kinds import CONTACT_KINDS, ContactKind, contact_kind, geometric_play, play_mm
from apo_bench.assembly.lowering import lowered, lowered_observation, lowered_together
from apo_bench.assembly.outlier_model import OutlierModel, measured_rates
from apo_bench.assembly.pattern import Pattern, looking_away
from apo_bench.assembly.reached import InHand, Outcome, Reached, ReplayResult, Snapshot
from apo_bench.assembly.shared_error import SharedError, first_order, joint_covariance
from apo_bench.assembly.tails import Tails
from apo_bench.assembly.topology import (
    ODL,
    Assembly,
    Contact,
    Gap,
    GapKind,
    Operation,
    PartFace,
    Relation,
    inverted,
    product,
    simplified,
    spelled,
)
from apo_bench.assembly.touching import TouchedContact, corners, mouth, outline_points, touched_contacts

__all__ = (
    "CONTACT_KINDS",
    "ODL",
    "SCHEDULE_REMEDY",
    "Arc",
    "ArcResiduals",
    "Assembly",
    "Consistency",
    "Contact",
    "ContactKind",
    "Correction",
    "Demonstration",
    "Equations",
    "Facing",
    "Gap",
    "GapKind",
    "Graph",
    "InHand",
    "Iterate",
    "Layout",
    "Look",
    "LookingCorrector",
    "Node",
    "Observation",
    "Operation",
    "Outcome",
    "OutlierModel",
    "PartFace",
    "Pattern",
    "Plan",
    "Poses",
    "Reached",
    "Relation",
    "ReplayResult",
    "SharedError",
    "Snapshot",
    "Step",
    "Suspect",
    "Tails",
    "TouchedContact",
    "Try",
    "apart_limit_mm",
    "arc_residuals",
    "contact_kind",
    "corners",
    "deep_limit_mm",
    "face_gap",
    "first_order",
    "geometric_play",
    "goals_in_force",
    "height",
    "inverted",
    "joint_covariance",
    "joint_play_mm",
    "largest",
    "largest_gap",
    "looking_away",
    "lowered",
    "lowered_observation",
    "lowered_together",
    "measure_round",
    "measured_rates",
    "mouth",
    "observed_residuals",
    "opposed",
    "outline_points",
    "placements",
    "play_mm",
    "product",
    "relation_graph",
    "round_pairs",
    "schedule_fault",
    "simplified",
    "spelled",
    "touched_contacts",
)
