"""Several accelerometers in one pass over the positions of a dividing head: triads, and units beside each other."""
