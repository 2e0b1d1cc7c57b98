"""The corrector `contact`: its problem, the nearest poses, their test, other starts, and which relation to suspect."""
