"""Calibration of a micromechanical gyro with voltage output on a rate table (docs/procedures/mems_gyro.md)."""
