"""Stimuli, and what was captured meanwhile."""
