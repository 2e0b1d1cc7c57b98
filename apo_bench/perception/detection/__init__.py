"""Recognition: what is where, which faces touch, in which states of contact, and by which macros they came there."""
