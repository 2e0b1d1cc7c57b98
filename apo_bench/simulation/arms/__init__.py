"""Arms: read their files, build their models, solve their kinematics."""
