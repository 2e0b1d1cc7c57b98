"""The robot probes fixed surfaces and held parts to estimate its calibration."""
