"""Accelerometers against temperature: polynomial compensation, its choice of degree, its export to a computer."""
