"""The wires to a unit and the log formats: CAN, CANopen services, line port, bus port, control socket, VCD."""
