"""What any correction is asked: is it what was agreed, how did it end, and does the stated noise explain it."""
