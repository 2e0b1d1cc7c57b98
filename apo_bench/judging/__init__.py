"""The judge: is the assembly right? Knows geometry, the assembly and what was reached, nothing else."""
