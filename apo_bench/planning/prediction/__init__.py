"""Failure prediction: whether a plan will fail, where and why, before anything moves."""
