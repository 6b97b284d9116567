"""A unit calibrated from its own navigation ("secondary information"): recordings, a run on a bench, estimates, report."""
