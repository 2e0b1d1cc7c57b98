"""Success over level: curves, the level of half success, the area below."""
