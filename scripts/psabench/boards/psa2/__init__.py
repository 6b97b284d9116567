"""PSA-2 and PSA-1."""
