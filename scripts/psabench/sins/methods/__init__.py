"""Calibrations of a strapdown unit by other methods than the filter: six positions and turns, Fourier series.

Pure: increments and the plan in, errors of both triads out, in the article's gauge. docs/procedures/sins_methods.md
derives them.
"""
