"""The conformance tests of PIK, PIK-5 and PIK-6: stimulus, capture, check."""
