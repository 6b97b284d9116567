"""The bench of test_cycles and test_cycles_host: a unit of every board."""

from __future__ import annotations

from psabench.boards.pik.device import Pik
from psabench.boards.pmka.device import Pmka
from psabench.boards.psa2.device import Psa2
from psabench.boards.psd1.device import Psd1
from psabench.boards.unit import Unit
from rig import HERE

SCENARIO = HERE / "cycles.yaml"
NODES: dict[str, tuple[type[Unit], int]] = {
    "psa2": (Psa2, 5), "psd1": (Psd1, 6), "pmka": (Pmka, 7), "pik": (Pik, 8), "psd1_host": (Psd1, 16),
}  # fmt: skip
SETUP_S = 0.5  # of the slowest: self-calibrations
