"""Planner: rotations that calibrate a strapdown unit best, within a table's limits and a time."""
