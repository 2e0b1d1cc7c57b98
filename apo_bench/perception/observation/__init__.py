"""What a camera sees of a demonstration: noise models, and wrong relations."""
