"""The gyro unit."""
