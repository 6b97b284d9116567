"""Flights of a strapdown unit with a satellite receiver (КОИ): what is done with a flight's estimates.

The filter is of libpsabench-nav; here are the decision at take-off and what a unit's passport learns flight by flight.
"""
