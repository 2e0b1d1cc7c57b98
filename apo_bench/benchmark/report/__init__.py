"""What a sweep says, as a page, tables and figures: rows in, files out."""
