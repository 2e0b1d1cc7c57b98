"""Solids of CAD files: meshes, regions of their surface, names, lengths in mm."""

from apo_bench.importers.cad.solids.bodies import body_of, mesh_of, simplify
from apo_bench.importers.cad.solids.mesh import Mesh, concatenate_meshes, connected_groups
from apo_bench.importers.cad.solids.naming import clean_title, free_name, name_regions, part_name
from apo_bench.importers.cad.solids.raw_solid import RawSolid, Rgb, SolidPlace, merge_copies
from apo_bench.importers.cad.solids.region import SAME_CORNER_MM, Region, square_to

__all__ = [
    "SAME_CORNER_MM",
    "Mesh",
    "RawSolid",
    "Region",
    "Rgb",
    "SolidPlace",
    "body_of",
    "clean_title",
    "concatenate_meshes",
    "connected_groups",
    "free_name",
    "merge_copies",
    "mesh_of",
    "name_regions",
    "part_name",
    "simplify",
    "square_to",
]
