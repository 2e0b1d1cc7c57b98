"""What an import of a CAD file did: in lines, as a form, as a picture."""
