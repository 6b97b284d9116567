"""Files and probes to evidence."""
