"""The folder of a sweep: records, timings and description of the run."""
