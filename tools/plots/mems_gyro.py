#!/usr/bin/env python3
"""Draw docs/img/mems_gyro.svg of docs/procedures/mems_gyro.md: noise of an emulated gyro at rest. Same bytes.

tools/plots/mems_gyro.py [docs/img]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from psabench.mems_gyro.page import draw_allan  # noqa: E402
from psabench.mems_gyro.params import MemsGyroOptions  # noqa: E402
from psabench.mems_gyro.run import run_gyro  # noqa: E402
from psabench.procedures.head_bench import Silent  # noqa: E402
from psabench.report import plots  # noqa: E402


def main() -> int:
    """Entry point."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    with tempfile.TemporaryDirectory() as folder:
        run = run_gyro(MemsGyroOptions(out=Path(folder)), Silent())
    (out / "mems_gyro.svg").write_text(plots.standalone(draw_allan(run)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
