"""The folder of a sweep: its rows, `run.json`, and what is read off them."""
