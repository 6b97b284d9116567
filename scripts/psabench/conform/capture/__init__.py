"""What the wires of a board showed, and how it is read."""
