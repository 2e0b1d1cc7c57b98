"""The arm in motion: lines followed, contacts felt."""
