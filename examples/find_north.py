"""A million gyrocompasses with the article's errors, and one that turns back and forth and reads its encoder."""

from dataclasses import replace

import numpy as np
from psabench.native import nav_mc
from psabench.native.nav import ARCMIN, DEGPH, Method, Noise

article = nav_mc.McConfig()
improved = replace(
    article,
    angles_rad=tuple(np.radians([0, 180, 90, 270] * 6)),
    window_s=5.0,
    gap_s=5.0,
    angle_sys=nav_mc.AngleSys.NONE,
    angle_random_rad=0.5 * ARCMIN,
    simplified=False,
    method=Method.GLS,
    noise=Noise(gm_sigma_radps=0.2 * DEGPH, angle_sd_rad=0.5 * ARCMIN),
)
for name, cfg in (("article", article), ("improved", improved)):
    error_deg = np.degrees(nav_mc.closed(cfg, seed=1, runs=1_000_000, threads=2).heading_rad)
    print(f"{name:9s} sd {error_deg.std():.3f} deg, 95 % within {np.quantile(np.abs(error_deg), 0.95):.3f} deg")
