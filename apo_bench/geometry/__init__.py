"""Poses, faces, solids and the overlap of facing faces: numpy and shapely only."""
