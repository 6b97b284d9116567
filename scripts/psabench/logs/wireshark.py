"""Wireshark's dissector of the DBC's messages, as Lua: named fields with units in a pcap of the bus.

`python -m psabench.logs.wireshark > share/wireshark/psabench.lua` writes it. It takes the DBC's identifiers, thus the
boards' default nodes. Source: Wireshark's Lua API (Proto, ProtoField, DissectorTable "can.id").
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

from psabench.link.protocol_files import database
from psabench.logs.records import columns

HEAD = """\
-- Fields of the boards' CAN messages. Written by `python -m psabench.logs.wireshark` from proto/psabench.dbc.
-- Use: tshark -X lua_script:psabench.lua -r run.pcap -V, or copy it to Wireshark's folder of personal plugins.
local psabench = Proto("psabench", "psabench CAN message")
local fields, layouts = {}, {}

-- Little-endian signal of up to 32 bits.
local function raw(tvb, start, bits, signed)
    local value = 0
    for i = start + bits - 1, start, -1 do
        local byte = tvb(math.floor(i / 8), 1):uint()
        value = value * 2 + math.floor(byte / 2 ^ (i % 8)) % 2
    end
    if signed and value >= 2 ^ (bits - 1) then value = value - 2 ^ bits end
    return value
end

local function add(id, name, length)
    layouts[id] = { name = name, length = length }
end

local function signal(id, filter, name, unit, start, bits, signed, scale, offset)
    local field = ProtoField.double(filter, name .. (unit ~= "" and " [" .. unit .. "]" or ""))
    table.insert(fields, field)
    table.insert(layouts[id], { field, start, bits, signed, scale, offset })
end

"""

TAIL = """\

psabench.fields = fields
local id_field = Field.new("can.id")

function psabench.dissector(tvb, pinfo, tree)
    local layout = layouts[id_field().value]
    if not layout or tvb:len() < layout.length then return 0 end
    pinfo.cols.protocol = "psabench"
    pinfo.cols.info = layout.name
    local branch = tree:add(psabench, tvb(), layout.name)
    for _, s in ipairs(layout) do
        local first, last = math.floor(s[2] / 8), math.floor((s[2] + s[3] - 1) / 8)
        branch:add(s[1], tvb(first, last - first + 1), raw(tvb, s[2], s[3], s[4]) * s[5] + s[6])
    end
    return tvb:len()
end

for id in pairs(layouts) do DissectorTable.get("can.id"):add(id, psabench) end
"""


def dissector_text() -> str:
    """The whole script."""
    body = (line for m in sorted(database().messages, key=lambda m: m.frame_id) for line in _message_table(m))
    return HEAD + "\n".join(body) + "\n" + TAIL


def _message_table(m: Any) -> Iterator[str]:
    yield f'add({m.frame_id}, "{m.name}", {m.length})'
    names = columns(m.name)
    for s in m.signals:
        name = f"psabench.{m.name}.{names[s.name]}".lower()
        layout = f"{s.start}, {s.length}, {str(s.is_signed).lower()}, {float(s.scale)!r}, {float(s.offset)!r}"
        yield f'signal({m.frame_id}, "{name}", "{s.name}", "{s.unit or ""}", {layout})'


if __name__ == "__main__":
    sys.stdout.write(dissector_text())
