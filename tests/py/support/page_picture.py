"""A picture of a page, compared with the one in docs/img; PSABENCH_PICTURES=1 draws that one."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from PIL import Image

PICTURES = Path(__file__).parents[3] / "docs/img"
BLOCK = 20  # pixels: fonts differ between machines, so means of blocks are compared


def looks_as(shot: Path, name: str) -> None:
    """The same machine differs by 0.0008 and 0 blocks, one chart in another's place by 0.009 and 6 % of them."""
    picture = PICTURES / name
    if os.environ.get("PSABENCH_PICTURES"):
        Image.open(shot).convert("RGB").quantize(48).save(picture, optimize=True)
    assert picture.stat().st_size < 150_000
    difference = np.abs(blocks(shot) - blocks(picture))
    assert difference.mean() < 0.004
    assert (difference > 0.05).mean() < 0.02


def blocks(path: Path) -> npt.NDArray[np.float64]:
    """Mean brightness of each block, 0 to 1."""
    grey = np.asarray(plt.imread(path), dtype=np.float64)[..., :3].mean(axis=2)
    rows, columns = (n // BLOCK for n in grey.shape)
    cut = grey[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)
    return np.asarray(cut.mean(axis=(1, 3)))
