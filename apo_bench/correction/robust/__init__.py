"""Correction of observations with outliers or missing operations: the corrector `contact-robust`."""
