"""The conformance tests of the inertial unit: stimulus and check."""
