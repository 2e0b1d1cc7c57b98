"""Geometry of insertion: contact states, macros (straight motions), and the straight line on which a part arrives."""
