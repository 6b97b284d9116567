"""The bench as a MAVLink system: `psabench mavlink`, a bridge from a board on CAN to stations (docs/tools/mavlink.md)."""
