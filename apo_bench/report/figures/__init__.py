"""The figures of a report: drawn once by matplotlib, shown in the page and kept as files."""
