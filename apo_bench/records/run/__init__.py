"""The folder of a sweep."""
