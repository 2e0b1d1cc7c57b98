"""Data model of an assembly: topology, poses, observations, plans and corrections, in the terms of the paper."""

from apo_bench.assembly.contact_kinds import ContactKind, classify_contact, compute_geometric_play, compute_play_mm
from apo_bench.assembly.contact_measurements import ContactMeasurements, OverlapOrMate, measure_round_contact
from apo_bench.assembly.correction_record import (
    Consistency,
    Correction,
    FreeingTrial,
    Hypothesis,
    Iterate,
    Reobserver,
    ReobservingCorrector,
    Suspect,
)
from apo_bench.assembly.demonstration import Demonstration, Layout
from apo_bench.assembly.equation_pattern import EquationPattern, find_equation_pattern, find_faces_away
from apo_bench.assembly.equations import Equations, build_contact_equations, find_largest_residual, measure_largest_gap
from apo_bench.assembly.facing_pairs import faces_oppose, measure_face_gap, measure_height
from apo_bench.assembly.heavy_tails import Tails
from apo_bench.assembly.joint_play import compute_apart_limit_mm, compute_deep_limit_mm, compute_joint_play_mm
from apo_bench.assembly.observation import Observation
from apo_bench.assembly.outlier_model import OutlierModel, make_measured_model
from apo_bench.assembly.plan import SCHEDULE_REMEDY, Plan, Step, find_schedule_fault, list_poses_between_undos
from apo_bench.assembly.poses import Poses, compute_placements, list_alternatives
from apo_bench.assembly.probing_touch import Touch
from apo_bench.assembly.relation_graph import (
    Arc,
    ArcResiduals,
    Graph,
    Node,
    build_relation_graph,
    compute_arc_residuals,
    compute_observed_residuals,
)
from apo_bench.assembly.replay_result import Outcome, ProbingResult, ReachedState, ReplayResult, SlipInHand, Snapshot
from apo_bench.assembly.resting_contacts import (
    TouchedContact,
    find_touch_points,
    find_touched_contacts,
    list_outline_points,
    measure_entrance_depth,
)
from apo_bench.assembly.round_contacts_as_planes import project_observation, project_observations, project_round_faces
from apo_bench.assembly.round_face_pairs import FacingPair, find_round_pairs, measure_round_pair
from apo_bench.assembly.shared_error import SharedError, compute_joint_covariance, correlate_first_order
from apo_bench.assembly.topology import (
    ODL,
    Assembly,
    Contact,
    Gap,
    GapKind,
    Operation,
    PartFace,
    Relation,
    evaluate_odl,
    invert,
    simplify_odl,
    spell,
)

__all__ = (
    "ODL",
    "SCHEDULE_REMEDY",
    "Arc",
    "ArcResiduals",
    "Assembly",
    "Consistency",
    "Contact",
    "ContactKind",
    "ContactMeasurements",
    "Correction",
    "Demonstration",
    "EquationPattern",
    "Equations",
    "FacingPair",
    "FreeingTrial",
    "Gap",
    "GapKind",
    "Graph",
    "Hypothesis",
    "Iterate",
    "Layout",
    "Node",
    "Observation",
    "Operation",
    "Outcome",
    "OutlierModel",
    "OverlapOrMate",
    "PartFace",
    "Plan",
    "Poses",
    "ProbingResult",
    "ReachedState",
    "Relation",
    "Reobserver",
    "ReobservingCorrector",
    "ReplayResult",
    "SharedError",
    "SlipInHand",
    "Snapshot",
    "Step",
    "Suspect",
    "Tails",
    "Touch",
    "TouchedContact",
    "build_contact_equations",
    "build_relation_graph",
    "classify_contact",
    "compute_apart_limit_mm",
    "compute_arc_residuals",
    "compute_deep_limit_mm",
    "compute_geometric_play",
    "compute_joint_covariance",
    "compute_joint_play_mm",
    "compute_observed_residuals",
    "compute_placements",
    "compute_play_mm",
    "correlate_first_order",
    "evaluate_odl",
    "faces_oppose",
    "find_equation_pattern",
    "find_faces_away",
    "find_largest_residual",
    "find_round_pairs",
    "find_schedule_fault",
    "find_touch_points",
    "find_touched_contacts",
    "invert",
    "list_alternatives",
    "list_outline_points",
    "list_poses_between_undos",
    "make_measured_model",
    "measure_entrance_depth",
    "measure_face_gap",
    "measure_height",
    "measure_largest_gap",
    "measure_round_contact",
    "measure_round_pair",
    "project_observation",
    "project_observations",
    "project_round_faces",
    "simplify_odl",
    "spell",
)
