"""Stimuli, and what was seen meanwhile."""
