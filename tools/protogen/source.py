"""Reads proto/psabench.yaml and proto/<board>.yaml; unit.yaml has what boards share, and the grammar of their files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from protogen.model import BUS, BUS_REGISTERS, ROOT, Entry, Message, Object, Protocol, Signal

SOURCE = ROOT / "proto/psabench.yaml"
UNIT_SOURCE = ROOT / "proto/unit.yaml"
PDO_VALID_NO_RTR = 0x40000000
PDO_INVALID_NO_RTR = 0xC0000000
# What every device has from psabench.yaml: messages of its own under its name, and objects.
SERVICES = ("EMCY", "SDO_TX", "SDO_RX", "HEARTBEAT")
COMMON_OBJECTS_END, REMARK = 0x1800, 0x2040
HIGHEST = "Highest sub-index supported"

YAML_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml's where there is one: ten times faster


def parse_yaml(text: str) -> Any:
    """The values of a document. Raises yaml.YAMLError."""
    return yaml.load(text, YAML_LOADER)


def read_message(m: dict[str, Any]) -> Message:
    """Expand the repeated signals of a message: NAME0 .. NAMEn at their places."""
    rest = {k: v for k, v in m.items() if k not in ("signals", "repeat", "repeated")}
    signals = [Signal(**s) for s in m["signals"]]
    repeat = m.get("repeat", {"count": 0})
    for i in range(repeat["count"]):
        for s in m["repeated"]:
            place = repeat["start"] + i * repeat["bits"] + s["start"]
            comment = f"{s['comment']}, {repeat['what']} {i}"
            signals.append(Signal(**{**s, "name": f"{s['name']}{i}", "start": place, "comment": comment}))
    return Message(**rest, signals=tuple(signals))


def record(index: int, name: str, subs: list[dict[str, Any]], **more: Any) -> Object:
    """An object with sub-indices: sub 0 holds their number unless the source says otherwise."""
    first = {"name": HIGHEST, "type": "UNSIGNED8", "access": "const", "value": len(subs)}
    first.update(more.pop("sub0", {}))
    entries = [Entry(index=index, sub=k, **s) for k, s in enumerate([first, *subs])]
    return Object(index=index, name=name, entries=tuple(entries), var=False, **more)


def read_object(o: dict[str, Any], source: dict[str, Any]) -> Object:
    """One object of the list; registers stand for one UNSIGNED8 entry each."""
    about = {k: o[k] for k in ("const", "comment") if k in o}
    if "registers" in o:
        subs = []
        for r in source["registers"][o["registers"]]:
            row = {"type": "UNSIGNED8", "access": "rw", **r, "value": r["reset"]}
            del row["reset"]
            subs.append(row)
        return record(o["index"], o["name"], subs, **about)
    if "subs" in o:
        more = {"sub0": o["sub0"]} if "sub0" in o else {}
        return record(o["index"], o["name"], o["subs"], **about, **more)
    one = {k: v for k, v in o.items() if k != "const"}
    return Object(index=o["index"], name=o["name"], entries=(Entry(**one, sub=0),), var=True, const=o.get("const", ""))


def tpdo_objects(tpdos: list[dict[str, Any]], forms: list[dict[str, Any]]) -> list[Object]:
    """1800h.. and 1A00h..; valid by default: those of frame form 0, or all that are not optional."""
    out = []
    for k, t in enumerate(tpdos):
        valid = t["message"] in forms[0]["messages"] if forms else not t.get("optional", False)
        switch = "; the frame form sets and clears bit 31" if forms else ""
        cob = t["cob"] + (PDO_VALID_NO_RTR if valid else PDO_INVALID_NO_RTR)
        u32 = {"type": "UNSIGNED32", "access": "const"}
        comm: list[dict[str, Any]] = [
            {"name": "COB-ID", "type": "UNSIGNED32", "access": "rw", "value": cob, "plus_node": True,
             "comment": f"bit 31: not sent, bit 30: no RTR{switch}"},
            {"name": "Transmission type", "type": "UNSIGNED8", "access": "rw", "value": 254,
             "comment": "254, 255: each sample; 0: at SYNC if there is a new one; 1..240: at every n-th SYNC"},
            {"name": "Inhibit time", "type": "UNSIGNED16", "access": "rw", "value": 0, "unit": "100 us"},
        ]  # fmt: skip
        mapped = [
            {**u32, "name": f"Mapped object {i + 1}", "value": index << 16 | sub << 8 | bits}
            for i, (index, sub, bits) in enumerate(t.get("map", []))
        ]
        name = f"{t['message']}: TPDO {k + 1}"
        out.append(record(0x1800 + k, f"{name} communication", comm))
        out.append(record(0x1A00 + k, f"{name} mapping", mapped))
    return out


def load(path: Path = SOURCE) -> Protocol:
    """PSA-2, read and expanded; raises KeyError or TypeError where the source does not have the expected shape."""
    source = parse_yaml(path.read_text())
    objects = [read_object(o, source) for o in source["objects"]]
    objects += tpdo_objects(source["tpdos"], source["forms"])
    return Protocol(
        key="psa2",
        source=str(path.relative_to(ROOT)),
        device=source["device"],
        nodes=source["nodes"],
        messages=tuple(read_message(m) for m in source["messages"]),
        objects=tuple(sorted(objects, key=lambda o: o.index)),
        emcy=source["emcy"],
        forms=source["forms"],
        tpdos=source["tpdos"],
    )


# ---- the other boards: proto/unit.yaml says how their files look ----


def service(m: Message, source: dict[str, Any], key: str, base_node: int) -> Message:
    """A service of PSA-2 as this device has it: under its name, at its node."""
    name, sender = key.upper(), key.upper() if m.sender != "HOST" else m.sender
    sources = source.get("emcy_sources", {0: "unit", 3: "can_stream"})
    signals = [replace(s, values=sources) if s.name == "SOURCE" else s for s in m.signals]
    number = m.id - base_node + source["device"]["node"]
    return replace(m, name=f"{name}_{m.name}", id=number, sender=sender, signals=tuple(signals))


def unit_messages(source: dict[str, Any], key: str, base: Protocol) -> list[Message]:
    """EMCY, the device's own, SDO and heartbeat; ids of its own are given as the base, the node is added."""
    own = []
    for m in source["messages"]:
        placed = {"node": True, "sender": key.upper(), **m, "id": m["id"] + source["device"]["node"]}
        own.append(read_message(placed))
    emcy, *rest = [service(m, source, key, base.device["node"]) for m in base.messages if m.name in SERVICES]
    return [emcy, *own, *rest]


def bus_object(rows: list[dict[str, Any]]) -> Object:
    """2002h: the registers on the parallel bus; sub-index = address + 1, nothing where the bus has nothing."""
    entries: list[Entry] = []
    address = 0
    for r in rows:
        address = r.get("address", address)
        if address not in BUS_REGISTERS or (entries and address < entries[-1].sub):
            raise ValueError(f"bus: {r['name']}: address {address}")
        row = {"type": "UNSIGNED16", "access": "rw", **{k: v for k, v in r.items() if k not in ("address", "object")}}
        if "object" in r:
            index, sub = r["object"]
            row["comment"] += f"; as {index:04X}h:{sub}"
        entries.append(Entry(index=BUS, sub=address + 1, **row))
        address += 1
    highest = entries[-1].sub
    top = Entry(index=BUS, sub=0, name=HIGHEST, type="UNSIGNED8", access="const", value=highest)
    about = "sub-index = address + 1; a read is a read cycle, a write a write cycle with the strobe of 2051h"
    return Object(index=BUS, name="Bus", entries=(top, *entries), var=False, const="BUS", comment=about)


def unit_objects(source: dict[str, Any], base: Protocol) -> list[Object]:
    """Those of every device, those of every unit, its counters, its bus, its own."""
    named = {0x1008: source["device"]["name"]}
    objects = [
        replace(o, entries=(replace(o.entries[0], value=named[o.index]),)) if o.index in named else o
        for o in base.objects
        if o.index < COMMON_OBJECTS_END or o.index == REMARK
    ]
    for o in parse_yaml(UNIT_SOURCE.read_text())["objects"]:
        if o.pop("bus", False) and "bus" not in source:
            continue
        if o["const"] == "COUNTERS":
            rows = [{"type": "UNSIGNED32", "access": "ro", **c} for c in source["counters"]]
            o["subs"] += [{k: v for k, v in r.items() if k != "counter"} for r in rows]
        objects.append(read_object(o, source))
    own = [read_object(o, source) for o in source.get("objects", [])]
    if "bus" in source:
        check_doors(source["bus"], own)
        objects.append(bus_object(source["bus"]))
    return objects + own


def check_doors(rows: list[dict[str, Any]], objects: list[Object]) -> None:
    """A register that shows what an object shows names one that there is. Raises ValueError."""
    there = {(e.index, e.sub) for o in objects for e in o.entries}
    for r in rows:
        if "object" in r and tuple(r["object"]) not in there:
            raise ValueError(f"bus: {r['name']}: expected an object of this board, got {r['object']}")


def load_unit(path: Path, source: dict[str, Any], base: Protocol) -> Protocol:
    """A board of proto/<board>.yaml; base: PSA-2, whose services and communication objects it shares."""
    key = path.stem
    objects = unit_objects(source, base) + tpdo_objects(source["tpdos"], source.get("forms", []))
    for t in source["tpdos"]:
        if unknown := set(t) - {"message", "cob", "map", "optional"}:
            raise ValueError(f"{path.name}: TPDO {t['message']}: no such key: {unknown}")
    indices = [o.index for o in objects]
    if len(set(indices)) != len(indices):
        raise ValueError(f"{path.name}: an object occurs twice")
    common = [e for e in base.emcy if e["code"] < 0xFF00 or e["name"] == "STREAM_REFUSED"]
    return Protocol(
        key=key,
        source=str(path.relative_to(ROOT)),
        device=source["device"],
        nodes=[key.upper(), "HOST"],
        messages=tuple(unit_messages(source, key, base)),
        objects=tuple(sorted(objects, key=lambda o: o.index)),
        emcy=sorted(common + source.get("emcy", []), key=lambda e: int(e["code"])),
        forms=source.get("forms", []),
        tpdos=source["tpdos"],
        counters=tuple(c.get("counter", c["name"].lower().replace(" ", "_")) for c in source["counters"]),
        about=source.get("about", ""),
        unit=True,
    )


def load_all() -> list[Protocol]:
    """PSA-2 first, then each proto/*.yaml with a device, by its default node."""
    base = load()
    sources = {path: parse_yaml(path.read_text()) for path in (ROOT / "proto").glob("*.yaml") if path != SOURCE}
    units = [(path, source) for path, source in sources.items() if "device" in source]
    return [base, *(load_unit(path, s, base) for path, s in sorted(units, key=lambda u: u[1]["device"]["node"]))]
