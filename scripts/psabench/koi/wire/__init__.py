"""Flights over the wire: raw increments over CAN, the receiver's serial port, what is done where either fails."""
