"""In the process of its own that reads channels of an MF4 file: asammdf is loaded here and nowhere else."""

from __future__ import annotations

import json
import os
import resource
import sys
from typing import Any

import numpy as np

from psabench.conform.sources import mf4
from psabench.errors import expected

asammdf: Any = __import__("asammdf")  # before the bounds: how long it takes to load is not the file's doing


def columns_of(path: str, names: list[str]) -> np.ndarray:
    """(n, columns); channels of one length. `time` is the time of the first channel, where no channel has the name.

    Raises ValueError and whatever asammdf raises.
    """
    with asammdf.MDF(path) as file:
        signals = {name: file.get(name) for name in names if name in file}
        master = {name for name in names if name not in signals}
        if master - {"time", "t_s"} or not signals:
            missing = sorted(master)[0] if master else names[0]
            raise ValueError(expected(f"a channel {missing}", "none"))
        lengths = {name: len(s.samples) for name, s in signals.items()}
        if len(set(lengths.values())) != 1:
            raise ValueError(expected("channels of one length", lengths))
        first = next(iter(signals.values()))
        found = [np.asarray(signals[n].samples if n in signals else first.timestamps, np.float64) for n in names]
        return np.column_stack(found)


def main(path: str, out: str, names: str) -> None:
    """Ends the process at once, so that the last that it says is why it failed."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    mf4.limit(resource.RLIMIT_AS, mf4.MOST_MEMORY)
    mf4.limit(resource.RLIMIT_CPU, mf4.MOST_CPU_S + round(used.ru_utime + used.ru_stime) + 1)
    mf4.limit(resource.RLIMIT_CORE, 0)
    try:
        np.save(out, columns_of(path, json.loads(names)))
    except Exception as e:  # asammdf raises whatever its parsing comes to
        print(f"{type(e).__name__}: {' '.join(str(e).split())}", file=sys.stderr, flush=True)
        os._exit(1)
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
