"""How quantities are written on every page: symbols with their indices, signs, marks. The console has ASCII."""

from __future__ import annotations

import re

DAGGER = "<span class=flag title='not identifiable'>†</span>"


def symbol_html(text: str) -> str:
    """k_xy -> k<sub>xy</sub>, alpha0 -> α<sub>0</sub>, as the article writes them."""
    text = re.sub(r"\balpha0\b", "α_0", text)
    return re.sub(r"\b([A-Za-zα-ωϑ])_([a-z0-9]{1,2})(?![a-z0-9])", r"\1<sub>\2</sub>", text)


def page_words(text: str) -> str:
    """What the console writes in ASCII as pages write it: +- is ±, u is µ before a volt, ^2 is ²."""
    return re.sub(r"\buV\b", "µV", text.replace("+- ", "± ").replace("^2", "²"))
