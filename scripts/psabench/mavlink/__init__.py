"""The bench as a MAVLink system: `psabench mavlink`, a bridge between a board on CAN and ground stations (docs/mavlink.md)."""
