"""Accelerometers for the coverage runs: none is in a scenario, a test or a page of the project."""

from __future__ import annotations

from collections.abc import Mapping

PASSPORTS: Mapping[str, Mapping[str, float]] = {
    "low": {
        "u0_v": 1.6431,
        "kx_v_per_g": 0.3127,
        "ky_v_per_g": -0.0041,
        "kz_v_per_g": 0.0057,
        "kxy_v_per_g2": -0.00043,
        "kxx_v_per_g2": 0.00011,
        "kyy_v_per_g2": -0.00006,
        "alpha0_deg": -0.4372,
        "drift_v_per_s": -3.0e-9,
        "reading_noise_v": 4.0e-4,
    },
    "turned": {
        "u0_v": -0.0213,
        "kx_v_per_g": -1.9241,
        "ky_v_per_g": 0.0334,
        "kz_v_per_g": -0.0212,
        "kxy_v_per_g2": 0.0027,
        "kxx_v_per_g2": -0.00071,
        "kyy_v_per_g2": 0.00019,
        "alpha0_deg": 1.2083,
        "drift_v_per_s": 1.1e-8,
        "reading_noise_v": 7.0e-4,
    },
    "steep": {
        "u0_v": 4.0117,
        "kx_v_per_g": 3.8862,
        "ky_v_per_g": -0.0719,
        "kz_v_per_g": 0.0083,
        "kxy_v_per_g2": 0.0061,
        "kxx_v_per_g2": 0.0012,
        "kyy_v_per_g2": 0.0009,
        "alpha0_deg": 0.0527,
        "drift_v_per_s": 0.0,
        "reading_noise_v": 2.5e-3,
    },
}
