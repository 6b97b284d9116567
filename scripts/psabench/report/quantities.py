"""How quantities are written on every page: symbols with their indices, marks."""

from __future__ import annotations

import re

DAGGER = "<span class=flag title='not identifiable'>†</span>"


def symbol_html(text: str) -> str:
    """k_xy -> k<sub>xy</sub>, alpha0 -> α<sub>0</sub>, as the article writes them."""
    text = re.sub(r"\balpha0\b", "α_0", text)
    return re.sub(r"\b([A-Za-zα])_([a-z0-9]{1,2})(?![a-z0-9])", r"\1<sub>\2</sub>", text)
