"""Print every object of a board that can be read: its index, name and value. The EDS file is all this script knows."""

from typing import Any

import canopen
from canopen.objectdictionary import ODVariable

network = canopen.Network()
network.connect()
node = network.add_node(5, "proto/psa2.eds")
node.sdo.RESPONSE_TIMEOUT = 2.0
read = refused = 0


def show(entry: ODVariable, name: str, variable: Any) -> None:
    """One line; an object may refuse, say while the board sets up its converters."""
    global read, refused
    place = f"{entry.index:04X}h:{entry.subindex:02X}"
    try:
        value = variable.raw
    except canopen.SdoAbortedError as e:
        refused += 1
        print(f"{place:9} {name:40} {e}")
        return
    read += 1
    print(f"{place:9} {name:40} {value:#x}" if isinstance(value, int) else f"{place:9} {name:40} {value}")


try:
    for entry in node.object_dictionary.values():
        if isinstance(entry, ODVariable):
            if entry.readable:
                show(entry, entry.name, node.sdo[entry.index])
            continue
        for sub in entry.values():
            if sub.readable:
                show(sub, f"{entry.name}.{sub.name}", node.sdo[sub.index][sub.subindex])
finally:
    network.disconnect()
print(f"{read} read, {refused} refused")
