"""Which scenarios come with the package, by the shapes of their parts."""

BOXES = (
    "block_on_block",
    "bridge_cycle",
    "carried_bridge",
    "fixture_alignment",
    "pocket_table",
    "stick_in_tower",
    "stick_on_castles",
    "vanished_fixture",
)
"""The figures and examples of the paper."""
TILTED = ("dovetail", "wedge_under_roof")
