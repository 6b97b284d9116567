"""The conformance tests of TOY: stimulus and check."""
