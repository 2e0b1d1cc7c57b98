"""The relation graph, drawn as in the paper."""
