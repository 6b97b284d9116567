"""Pure tests of evidence: the same for a scene of the device suite and for a recording."""
