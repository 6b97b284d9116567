"""The conformance tests of the gyro unit: stimulus, capture, check."""
