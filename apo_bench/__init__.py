"""Does a robot's replay of an observed assembly fit, with and without correction by face contacts?"""

__version__ = "0.1.0"
