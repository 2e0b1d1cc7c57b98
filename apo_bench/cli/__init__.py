"""The command line, one file per command; where everything meets."""
