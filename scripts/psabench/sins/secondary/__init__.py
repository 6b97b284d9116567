"""A unit calibrated from its own navigation ("secondary information"): recordings, a bench, estimates, the report."""
