"""Passports of instruments: what was measured of each unit, by which run, and what is valid now."""
