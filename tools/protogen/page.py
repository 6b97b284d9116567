"""The protocol pages: a written head with tables in it."""

import re

from protogen.model import ROOT, Entry, Message, Protocol, resolved

RATES_HZ = (250, 500, 1000, 2000, 4000)
BUS = 0x2002  # the parallel bus, of units that have one
NO_BUS = """\
## Bus cycles

This unit has no parallel bus and no object 2002h: 2030h:10 and 2030h:11 stay 0.

"""


def worst_bits(m: Message) -> tuple[int, int]:
    """(nominal, data) bits with a stuff bit wherever the rule allows one: sources can 3.1, emu/base/can/bits.c."""
    data = 8 * m.len
    if not m.fd:
        stuffed = 1 + 11 + 3 + 4 + data + 15
        return stuffed + (stuffed - 1) // 4 + 13, 0
    dynamic, crc = 17 + 5 + data, 25 if m.len > 16 else 21
    stuff, stuff_nominal = (dynamic - 1) // 4, (17 - 1) // 4
    return 17 + stuff_nominal + 13, dynamic - 17 + stuff - stuff_nominal + crc + -(-crc // 4)


def load_table(p: Protocol) -> list[str]:
    by_name = {m.name: m for m in p.messages}
    if not p.forms:
        out = [
            "| frame | at worst | " + " | ".join(f"{r} /s" for r in RATES_HZ) + " |",
            "|---" * (2 + len(RATES_HZ)) + "|",
        ]
        for t in p.tpdos:
            us = worst_bits(by_name[t["message"]])[0]
            out.append(f"| {t['message']} | {us} us | " + " | ".join(f"{us * r / 1e4:.1f} %" for r in RATES_HZ) + " |")
        return [*out, ""]
    out = ["| form | frames | " + " | ".join(f"{r} /s" for r in RATES_HZ) + " |", "|---" * (2 + len(RATES_HZ)) + "|"]
    for f in p.forms:
        bits = [worst_bits(by_name[name]) for name in f["messages"]]
        sample_us = sum(n + d / 5 for n, d in bits) / f["samples"]
        cells = [f"{sample_us * r / 1e4:.1f} %" + (" **refused**" if sample_us * r > 1e6 else "") for r in RATES_HZ]
        out.append(f"| {f['value']} {f['name']} | {', '.join(f['messages'])} | " + " | ".join(cells) + " |")
    return [*out, ""]


def message_pages(p: Protocol) -> list[str]:
    out = ["| id | name | bytes | form | sender | |", "|---|---|---|---|---|---|"]
    for m in sorted(p.messages, key=lambda m: m.id):
        base = f"{m.id - p.device['node']:03X}h + node" if m.node else f"{m.id:03X}h"
        out.append(f"| {base} | {m.name} | {m.len} | {'FD + BRS' if m.fd else 'classic'} | {m.sender} | {m.comment} |")
    out.append("")
    for m in p.messages:
        out += [f"### {m.name}", "", "| bits | signal | type | scale | unit | |", "|---|---|---|---|---|---|"]
        for s in m.signals:
            what = s.comment + "".join(f"; {k} {v}" for k, v in sorted((s.values or {}).items()))
            kind = ("s" if s.signed else "u") + str(s.bits)
            scale = "1" if s.scale == 1.0 else f"{s.scale:.8g}"
            out.append(f"| {s.start}..{s.start + s.bits - 1} | {s.name} | {kind} | {scale} | {s.unit} | {what} |")
        out.append("")
    return out


def entry_default(p: Protocol, e: Entry) -> str:
    value = resolved(p, e)
    if e.type == "VISIBLE_STRING":
        return f"`{value}`" if value else ""
    if e.type == "REAL32" or (isinstance(value, int) and abs(value) < 10):
        return str(value)
    return f"{value:X}h" + (" + node" if e.plus_node else "") if e.type == "UNSIGNED32" else str(value)


def object_pages(p: Protocol) -> list[str]:
    out = ["| index | sub | name | type | access | default | limits | unit | |", "|---" * 9 + "|"]
    for o in p.objects:
        for e in o.entries:
            name = e.name if o.var or e.sub else f"**{o.name}**"
            about = e.comment if o.var or e.sub else o.comment
            about += "".join(f"; {k} {v}" for k, v in sorted((e.values or {}).items()))
            limits = "" if e.low is None else f"{e.low} .. {e.high}"
            cells = [f"{o.index:04X}h", str(e.sub), name, e.type, e.access, entry_default(p, e), limits, e.unit]
            out.append("| " + " | ".join([*cells, about.removeprefix("; ")]) + " |")
    return [*out, ""]


def emcy_table(p: Protocol) -> list[str]:
    out = ["| code | 1001h | meaning |", "|---|---|---|"]
    return out + [f"| {e['code']:04X}h | {e['register']:02X}h | {e['meaning']} |" for e in p.emcy] + [""]


def page(p: Protocol) -> str:
    """The written head, with the tables put in where it says so; {name} and the like stand for the device's."""
    tables = {
        "messages": message_pages(p),
        "load": load_table(p),
        "objects": object_pages(p),
        "emcy": emcy_table(p),
        "about": [p.about.rstrip(), ""] if p.about else [],
    }
    unit = p.unit
    head = ROOT / ("proto/protocol_unit_head.md" if unit else "proto/protocol_head.md")
    text = head.read_text()
    if unit:
        words = {"name": p.device["name"], "key": p.key, "KEY": p.key.upper(), "node": str(p.device["node"])}
        for word, meaning in words.items():
            text = text.replace(f"{{{word}}}", meaning)
    if unit and not any(o.index == BUS for o in p.objects):
        text = re.sub(r"## Bus cycles\n.*?(?=## )", NO_BUS, text, flags=re.DOTALL)
    for name, lines in tables.items():
        text = text.replace(f"<!-- {name} -->\n", "\n".join(lines) + "\n" if lines else "")
    return f"<!-- {p.generated}; the head is {head.relative_to(ROOT)} -->\n{text}"
