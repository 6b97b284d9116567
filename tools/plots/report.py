#!/usr/bin/env python3
"""Draw docs/img/report.svg: numbers of a calibration's report with their intervals, and where the truth is in each.

psabench run reversal --condition realistic --out build/run/picture
tools/plots/report.py build/run/picture/result.json [docs/img/report.svg]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
WIDTH, TOP, ROW = 860, 112, 27  # px
COLUMNS = {"estimate": 300, "U": 380, "unit": 396, "truth": 536}  # px, right ends, of the unit the left one
LANE, UNIT = 700, 62  # px: middle of the lanes, length of one U in them
SYMBOLS = {
    "u0_v": "zero u₀",
    "alpha0_deg": "mounting α₀",
    "kx_v_per_g": "scale kₓ",
    "ky_v_per_g": "cross axis k_y",
    "kz_v_per_g": "cross axis k_z",
    "kxy_v_per_g2": "product k_xy",
    "kxx_minus_kyy_v_per_g2": "squares kₓₓ − k_yy",
}
STYLE = """
text{font:14px system-ui,"Segoe UI","DejaVu Sans",sans-serif;fill:#1d2733}
.h{font-size:21px;font-weight:600}.m{fill:#5b6875;font-size:12.5px}.n{text-anchor:end;font-variant-numeric:tabular-nums}
.card{fill:#fff;stroke:#d3dae2}.good{fill:#217a4b}.band{fill:#1f6fb4;opacity:.13}.line{stroke:#dfe4ea}
.bar{stroke:#1f6fb4;stroke-width:2.2}.dot{fill:#1f6fb4}.truth{stroke:#c4572b;stroke-width:1.6}
@media(prefers-color-scheme:dark){text{fill:#e4e9ef}.m{fill:#97a4b2}.card{fill:#1a2129;stroke:#34404d}.good{fill:#5cc48d}
.line{stroke:#2c3641}.band{fill:#62aef0}.bar{stroke:#62aef0}.dot{fill:#62aef0}.truth{stroke:#f08a5d}}
"""


def text_at(x: float, y: float, text: str, kind: str = "") -> str:
    return f'<text x="{x:g}" y="{y:g}" class="{kind}">{escape(text)}</text>'


def rounded(value: float, u: float) -> str:
    """To the second digit of its expanded uncertainty."""
    return f"{value:.{max(0, -int(f'{u:.1e}'.partition('e')[2]) + 1)}f}".replace("-", "−")


def row_svg(estimate: Mapping[str, Any], y: float) -> Iterator[str]:
    u = estimate["expanded_u"]
    at = LANE + UNIT * (estimate["value"] - estimate["truth"]) / u
    yield f'<path class="line" d="M24 {y + 9:g}H{WIDTH - 24}"/>'
    yield text_at(28, y, SYMBOLS[estimate["name"]])
    yield text_at(COLUMNS["estimate"], y, rounded(estimate["value"], u), "n")
    yield text_at(COLUMNS["U"], y, rounded(u, u), "n")
    yield text_at(COLUMNS["unit"], y, estimate["unit"], "m")
    yield text_at(COLUMNS["truth"], y, rounded(estimate["truth"], u), "n")
    yield f'<path class="bar" d="M{at - UNIT:.1f} {y - 5:g}H{at + UNIT:.1f}"/>'
    yield f'<circle class="dot" cx="{at:.1f}" cy="{y - 5:g}" r="4.5"/>'


def report_svg(result: Mapping[str, Any]) -> str:
    """The first section's numbers that have a truth and a symbol."""
    section = result["sections"][0]
    rows = [e for e in section["estimates"] if e["name"] in SYMBOLS and "truth" in e and e["identifiable"]]
    inside = sum(abs(e["value"] - e["truth"]) <= 2 * e["expanded_u"] for e in section["estimates"] if "truth" in e)
    height = TOP + ROW * len(rows) + 38
    facts = f"{section['procedure']} · bench {section['label']} · {section['readings']} readings"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">',
        f"<title>A calibration's report</title><style>{STYLE}</style>",
        f'<rect class="card" x=".5" y=".5" width="{WIDTH - 1}" height="{height - 1}" rx="8"/>',
        text_at(24, 34, "Accelerometer calibration", "h"),
        text_at(24, 56, facts, "m"),
        text_at(24, 80, f"{inside} of {len(section['estimates'])} numbers are within 2 U of the truth", "good"),
        *(text_at(x, TOP - 10, name, "m n" if name != "unit" else "m") for name, x in COLUMNS.items()),
        text_at(LANE - 88, TOP - 10, "interval ± U, truth in the middle", "m"),
        f'<rect class="band" x="{LANE - UNIT}" y="{TOP}" width="{2 * UNIT}" height="{ROW * len(rows)}"/>',
        f'<path class="truth" d="M{LANE} {TOP}V{TOP + ROW * len(rows)}"/>',
    ]
    for k, estimate in enumerate(rows):
        parts += row_svg(estimate, TOP + ROW * k + 18)
    parts.append(
        text_at(
            24, height - 14, "Below in the report: budgets of uncertainty, residuals, correlation, provenance.", "m"
        )
    )
    return "\n".join([*parts, "</svg>", ""])


def main(argv: Sequence[str]) -> int:
    """Writes the picture."""
    if not argv:
        print(__doc__, file=sys.stderr)
        return 2
    out = Path(argv[1]) if len(argv) > 1 else ROOT / "docs/img/report.svg"
    out.write_text(report_svg(json.loads(Path(argv[0]).read_text(encoding="utf-8"))), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
