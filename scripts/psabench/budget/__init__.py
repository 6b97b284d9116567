"""Uncertainty budget of a calibration, after the GUM (JCGM 100:2008).

`accuracy` has what is known of the bench, `influences` what it does to each estimate, `gum` combines and expands.
"""
