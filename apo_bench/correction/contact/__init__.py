"""The corrector `contact`: its problem, the nearest goals, their test, other starts, and which relation to suspect."""
