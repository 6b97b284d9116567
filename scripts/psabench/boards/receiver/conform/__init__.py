"""The conformance tests of the receiver: stimulus and check."""
