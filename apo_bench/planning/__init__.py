"""Planning of insertions from contacts, and prediction of where a plan will fail."""
