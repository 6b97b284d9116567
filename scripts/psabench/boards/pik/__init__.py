"""PIK, PIK-5 and PIK-6."""
