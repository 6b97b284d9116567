"""The conformance tests of PSD-1: stimulus, capture, check."""
