"""Solids as CAD files hold them: meshes, regions of their surface, copies and names; lengths in mm."""

from apo_bench.importers.cad.solids.bodies import convert_to_manifold, convert_to_mesh, simplify_body
from apo_bench.importers.cad.solids.hull_solid import make_hull_solid
from apo_bench.importers.cad.solids.mesh import Mesh, concatenate_meshes, find_connected_groups
from apo_bench.importers.cad.solids.naming import clean_title, find_free_name, make_part_name, name_regions
from apo_bench.importers.cad.solids.raw_solid import RawSolid, Rgb, SolidPlace, merge_copies
from apo_bench.importers.cad.solids.region import SAME_CORNER_MM, Region, find_square_axes

__all__ = [
    "SAME_CORNER_MM",
    "Mesh",
    "RawSolid",
    "Region",
    "Rgb",
    "SolidPlace",
    "clean_title",
    "concatenate_meshes",
    "convert_to_manifold",
    "convert_to_mesh",
    "find_connected_groups",
    "find_free_name",
    "find_square_axes",
    "make_hull_solid",
    "make_part_name",
    "merge_copies",
    "name_regions",
    "simplify_body",
]
