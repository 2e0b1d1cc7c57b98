"""Files in MuJoCo's own format, read by MuJoCo, as plain data."""
