"""The bench as a MAVLink system: `psabench mavlink`, a bridge from CAN to stations (docs/tools/mavlink.md)."""
