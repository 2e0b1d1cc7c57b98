"""The corrector `contact`: most likely consistent poses, with test, posterior, suspects and other starts."""
