"""PSA-2 over CAN, where it has always been; the classes of all boards are in `devices`, what they share in `unit`."""

from psabench.devices.psa2 import (
    CONFIG0,
    DATA_HZ,
    DRATE,
    OPCODE,
    REGISTERS,
    SETTLE_PERIODS,
    SETUP_S,
    Psa2,
)
from psabench.unit import (
    ERROR_REGISTER,
    NMT_PREOP,
    NMT_RESET_COMMUNICATION,
    NMT_RESET_NODE,
    NMT_START,
    NMT_STOP,
)

__all__ = [
    "CONFIG0",
    "DATA_HZ",
    "DRATE",
    "ERROR_REGISTER",
    "NMT_PREOP",
    "NMT_RESET_COMMUNICATION",
    "NMT_RESET_NODE",
    "NMT_START",
    "NMT_STOP",
    "OPCODE",
    "REGISTERS",
    "SETTLE_PERIODS",
    "SETUP_S",
    "Psa2",
]
