"""Checks of a capture: the same for the device suite and for a recording."""
