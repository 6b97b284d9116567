"""Files and probes to capture."""
