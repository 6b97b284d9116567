"""The conformance tests of PMKA: stimulus, capture, check."""
