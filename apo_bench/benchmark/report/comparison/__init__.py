"""Two sweeps against each other: numbers, words, page."""
