"""The topology of an assembly, and the goals that flow over it, in the words of the paper. No solver, no simulator."""
