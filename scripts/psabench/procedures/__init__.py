"""Procedures over the wire: calibration, gyrocompassing, heading hold, comparison of converters."""
