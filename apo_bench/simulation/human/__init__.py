"""The hands of the human who demonstrates."""
