"""An LCM log as a table: python examples/lcm_to_pandas.py LOG [OUT.csv]. Readings of its first PSA-2.

A pandas DataFrame where pandas is installed, otherwise a NumPy structured array with the same columns; the CSV is the
same.
"""

import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
from psabench.lcm.event_log import read_events

COLUMNS = ("x_v", "y_v", "z_v", "sequence", "temp_code", "settled")


def table_of(log: Path) -> Any:
    """Rows of the first PSA-2 of the log: t_s since power-on, and COLUMNS."""
    rows, channel = [], ""
    for event in read_events(log):
        if event.channel.startswith("PSABENCH_PSA2_") and event.channel == (channel or event.channel):
            channel = event.channel
            values = event.values
            rows.append((values["t_ns"] / 1e9, *(values[name] for name in COLUMNS)))
    kinds = [("t_s", float), *((n, float if n.endswith("_v") else int) for n in COLUMNS)]
    return np.array(rows, dtype=kinds)


def main() -> None:
    log = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else log.with_suffix(".csv")
    table = table_of(log)
    if not len(table):
        raise SystemExit(f"{log}: expected readings of a PSA-2, got none")
    try:
        import pandas as pd
    except ImportError:
        print("NumPy: pandas is not installed")
        mean_v, t_s = table["x_v"].mean(), table["t_s"]
        with out.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([table.dtype.names, *table.tolist()])
    else:
        frame = pd.DataFrame(table)
        mean_v, t_s = frame["x_v"].mean(), frame["t_s"].to_numpy()
        frame.to_csv(out, index=False)
    print(f"{out}: {len(table)} readings, {t_s[-1] - t_s[0]:.3f} s, mean of X {mean_v:.6f} V")


if __name__ == "__main__":
    main()
