"""The topology of an assembly, and the poses that flow over it, in the words of the paper. No solver, no simulator."""

from apo_bench.assembly.contact_kinds import ContactKind, contact_kind, geometric_play, play_mm
from apo_bench.assembly.correction_record import (
    Consistency,
    Correction,
    Hypothesis,
    Iterate,
    Reobserver,
    ReobservingCorrector,
    Suspect,
    Try,
)
from apo_bench.assembly.demonstration import Demonstration, Layout
from apo_bench.assembly.equations import Equations, contact_equations, largest, largest_gap
from apo_bench.assembly.facing import face_gap, faces_oppose, height
from apo_bench.assembly.facing_round import Facing, measure_round, round_pairs
from apo_bench.assembly.graph import Arc, ArcResiduals, Graph, Node, arc_residuals, observed_residuals, relation_graph
from apo_bench.assembly.joint_play import apart_limit_mm, deep_limit_mm, joint_play_mm
from apo_bench.assembly.meeting import Lie, Meetings, measure_mate
from apo_bench.assembly.observation import Observation
from apo_bench.assembly.outlier_model import OutlierModel, measured_rates
from apo_bench.assembly.pattern import Pattern, contact_pattern, faces_away
from apo_bench.assembly.plan import SCHEDULE_REMEDY, Plan, Step, poses_in_force, schedule_fault
from apo_bench.assembly.poses import Poses, placements
from apo_bench.assembly.projection import project_observation, project_observations, project_round_faces
from apo_bench.assembly.reached import InHand, Outcome, ProbingResult, Reached, ReplayResult, Snapshot
from apo_bench.assembly.resting_contacts import TouchedContact, corners, mouth, outline_points, touched_contacts
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
    invert,
    product,
    simplify,
    spell,
)
from apo_bench.assembly.touch import Touch

__all__ = (
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
    "Hypothesis",
    "InHand",
    "Iterate",
    "Layout",
    "Lie",
    "Meetings",
    "Node",
    "Observation",
    "Operation",
    "Outcome",
    "OutlierModel",
    "PartFace",
    "Pattern",
    "Plan",
    "Poses",
    "ProbingResult",
    "Reached",
    "Relation",
    "Reobserver",
    "ReobservingCorrector",
    "ReplayResult",
    "SharedError",
    "Snapshot",
    "Step",
    "Suspect",
    "Tails",
    "Touch",
    "TouchedContact",
    "Try",
    "apart_limit_mm",
    "arc_residuals",
    "contact_equations",
    "contact_kind",
    "contact_pattern",
    "corners",
    "deep_limit_mm",
    "face_gap",
    "faces_away",
    "faces_oppose",
    "first_order",
    "geometric_play",
    "height",
    "invert",
    "joint_covariance",
    "joint_play_mm",
    "largest",
    "largest_gap",
    "measure_mate",
    "measure_round",
    "measured_rates",
    "mouth",
    "observed_residuals",
    "outline_points",
    "placements",
    "play_mm",
    "poses_in_force",
    "product",
    "project_observation",
    "project_observations",
    "project_round_faces",
    "relation_graph",
    "round_pairs",
    "schedule_fault",
    "simplify",
    "spell",
    "touched_contacts",
)
