"""The conformance tests of PSA-2 and PSA-1: stimulus, capture, check."""
