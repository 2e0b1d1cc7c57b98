"""Failure prediction: where and why a plan will fail, computed before the robot moves."""
