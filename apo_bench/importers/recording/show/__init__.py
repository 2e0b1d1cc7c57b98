"""What an import of a recording found: in lines and as a picture."""
