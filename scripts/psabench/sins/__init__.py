"""Strapdown systems: increments of a recording, calibration on a rate table.

Frame n is east, north, up; b the unit's axes.
"""
