"""The procedures of the bench repeated at temperatures of a chamber: converters compared, sensors calibrated."""
