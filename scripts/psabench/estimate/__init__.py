"""Estimation core: pure numpy; no link, no file, no waiting.

Angles in radians, voltages in volts, accelerations in units of the local g (so g = 1 in the article's
formulas), hence k_x, k_y, k_z in V/g and k_xy, k_xx, k_yy in V/g^2. The equation numbers are those of the
article on testing and calibration of micromechanical accelerometers; repairs to them are listed in
docs/procedures/fourier.md.
"""
