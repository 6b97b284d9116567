"""Accelerometers against temperature: the run in a chamber, compensation by polynomials, its export to a computer."""
