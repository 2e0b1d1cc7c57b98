"""The report of a sweep: page, tables and figures."""
