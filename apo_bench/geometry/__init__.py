"""Poses, faces, solids and the overlap of facing faces: numpy, shapely, and manifold3d for meshes."""

from apo_bench.geometry.arrays import Array, Ints, copyable, freeze, frozen, real, remembered
from apo_bench.geometry.clearance import physical_pieces, recede_pieces
from apo_bench.geometry.convex import all_corners, ball_around, balls_apart, passage, separating_axes, shadow
from apo_bench.geometry.covering import Overlap, beside, face_area, overlap, overlap_area, own_shape, plane_frame
from apo_bench.geometry.exact_turns import depth_inside
from apo_bench.geometry.flips import Flips, approximate_symmetries
from apo_bench.geometry.hull import SAGITTA_M, Cylinder, Hull, cylinder_hull, first_of_each, sides_of
from apo_bench.geometry.mating import Mate, angle_between, mate
from apo_bench.geometry.meshes import union_mesh
from apo_bench.geometry.pads import FINGER_ROOM_M, PAD_M, PadPlace, held_span, held_width, holds, holds_whole, is_held
from apo_bench.geometry.penetration import (
    TOUCH_M,
    drop,
    drop_depths,
    intrusion,
    intrusion_depths,
    upright_bounds,
    ways_out,
)
from apo_bench.geometry.polygon import across_axis, flat_area, plane_across, polygons_of, rings_of, straighten
from apo_bench.geometry.pose import FARTHEST_M, is_rigid
from apo_bench.geometry.round_face import WHOLE_TURN, RoundFace
from apo_bench.geometry.solid import Box, Face, Piece, Solid, all_boxes, extent, world_bounds
from apo_bench.geometry.swept import Posed, exit_distance, is_way_free
from apo_bench.geometry.symmetry import (
    folds,
    nearest_alike,
    nearest_symmetric_pose,
    quarter_turns,
    revolution,
    symmetries,
    turn_about,
    turn_alike,
)
from apo_bench.geometry.twist import ADJOINTS, GENERATORS, exp_and_jacobian, right_jacobian

__all__ = (
    "ADJOINTS",
    "FARTHEST_M",
    "FINGER_ROOM_M",
    "GENERATORS",
    "PAD_M",
    "SAGITTA_M",
    "TOUCH_M",
    "WHOLE_TURN",
    "Array",
    "Box",
    "Cylinder",
    "Face",
    "Flips",
    "Hull",
    "Ints",
    "Mate",
    "Overlap",
    "PadPlace",
    "Piece",
    "Posed",
    "RoundFace",
    "Solid",
    "across_axis",
    "all_boxes",
    "all_corners",
    "angle_between",
    "approximate_symmetries",
    "ball_around",
    "balls_apart",
    "beside",
    "copyable",
    "cylinder_hull",
    "depth_inside",
    "drop",
    "drop_depths",
    "exit_distance",
    "exp_and_jacobian",
    "extent",
    "face_area",
    "first_of_each",
    "flat_area",
    "folds",
    "freeze",
    "frozen",
    "held_span",
    "held_width",
    "holds",
    "holds_whole",
    "intrusion",
    "intrusion_depths",
    "is_held",
    "is_rigid",
    "is_way_free",
    "mate",
    "nearest_alike",
    "nearest_symmetric_pose",
    "overlap",
    "overlap_area",
    "own_shape",
    "passage",
    "physical_pieces",
    "plane_across",
    "plane_frame",
    "polygons_of",
    "quarter_turns",
    "real",
    "recede_pieces",
    "remembered",
    "revolution",
    "right_jacobian",
    "rings_of",
    "separating_axes",
    "shadow",
    "sides_of",
    "straighten",
    "symmetries",
    "turn_about",
    "turn_alike",
    "union_mesh",
    "upright_bounds",
    "ways_out",
    "world_bounds",
)
