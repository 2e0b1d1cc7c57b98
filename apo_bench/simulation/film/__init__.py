"""What happened in a trial, kept moment by moment, and shown: as a film, in a window, in a browser."""
