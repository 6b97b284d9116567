"""The messages of all devices as a DBC."""

from protogen.model import Message, Protocol, Signal

# The list every DBC tool expects: the attribute's value is a position in it.
FRAME_FORMATS = ['"StandardCAN"', '"ExtendedCAN"', *['"reserved"'] * 12, '"StandardCAN_FD"', '"ExtendedCAN_FD"']


def dbc_signal(s: Signal, receiver: str) -> str:
    low, high = s.raw_range
    sign = "-" if s.signed else "+"
    limits = f"[{low * s.scale!r}|{high * s.scale!r}]" if s.scale != 1.0 else f"[{low}|{high}]"
    scale = repr(s.scale) if s.scale != 1.0 else "1"
    return f' SG_ {s.name} : {s.start}|{s.bits}@1{sign} ({scale},0) {limits} "{s.unit}" {receiver}'


def dbc_receiver(m: Message, protocols: list[Protocol]) -> str:
    """Who hears a message: the host a device's, a device the host's to it, and all of them what has no node."""
    if m.sender != "HOST":
        return "HOST"
    of = [p.nodes[0] for p in protocols if m in p.messages]
    return ",".join(of if m.node else [p.nodes[0] for p in protocols])


def dbc(protocols: list[Protocol]) -> str:
    """The messages as a DBC for the default node of each device."""
    messages = [m for p in protocols for m in p.messages]
    nodes = protocols[0].nodes + [p.nodes[0] for p in protocols[1:]]
    out = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: " + " ".join(nodes), ""]
    for m in messages:
        receiver = dbc_receiver(m, protocols)
        out.append(f"BO_ {m.id} {m.name}: {m.len} {m.sender}")
        out += [dbc_signal(s, receiver) for s in m.signals]
        out.append("")
    which = ", ".join(f"{p.nodes[0]} {p.device['node']}" for p in protocols)
    out.append(f'CM_ "{protocols[0].generated}. Identifiers are those of nodes {which}.";')
    for m in messages:
        out.append(f'CM_ BO_ {m.id} "{m.comment}";')
        out += [f'CM_ SG_ {m.id} {s.name} "{s.comment}";' for s in m.signals]
    out += [
        'BA_DEF_ "BusType" STRING ;',
        f'BA_DEF_ BO_ "VFrameFormat" ENUM {",".join(FRAME_FORMATS)};',
        'BA_DEF_DEF_ "BusType" "";',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        'BA_ "BusType" "CAN FD";',
    ]
    out += [f'BA_ "VFrameFormat" BO_ {m.id} 14;' for m in messages if m.fd]
    for m in messages:
        for s in m.signals:
            if s.values:
                choices = " ".join(f'{k} "{v}"' for k, v in sorted(s.values.items()))
                out.append(f"VAL_ {m.id} {s.name} {choices} ;")
    return "\n".join(out) + "\n"
