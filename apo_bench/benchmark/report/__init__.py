"""The report of a sweep: HTML page, tables and figures."""
