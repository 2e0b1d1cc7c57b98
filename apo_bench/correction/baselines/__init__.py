"""What `contact` is compared with: the correctors of the paper, and what a critic would ask for."""
