"""Scores of methods: tracks of fixed trials, entries in files, the leaderboard."""
