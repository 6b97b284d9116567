"""Object dictionaries as electronic data sheets (CiA 306-1)."""

from protogen.model import TYPES, Entry, Object, Protocol, resolved


def eds_number(p: Protocol, e: Entry) -> str:
    value = resolved(p, e)
    if e.type in ("REAL32", "VISIBLE_STRING") or e.type.startswith("INTEGER"):
        return str(value)
    return ("$NODEID+" if e.plus_node else "") + f"0x{value:X}"


def eds_entry(p: Protocol, e: Entry, section: str) -> list[str]:
    out = [f"[{section}]", f"ParameterName={e.name}", "ObjectType=0x7"]
    out += [f"DataType=0x{TYPES[e.type][0]:04X}", f"AccessType={e.access}"]
    if e.low is not None:
        out += [f"LowLimit={e.low}", f"HighLimit={e.high}"]
    return [*out, f"DefaultValue={eds_number(p, e)}", f"PDOMapping={int(e.map)}", ""]


def eds_object(p: Protocol, o: Object) -> list[str]:
    if o.var:
        return eds_entry(p, o.entries[0], f"{o.index:X}")
    kind = "0x8" if o.index == 0x1003 else "0x9"
    out = [f"[{o.index:X}]", f"ParameterName={o.name}", f"ObjectType={kind}", f"SubNumber={len(o.entries)}", ""]
    for e in o.entries:
        out += eds_entry(p, e, f"{o.index:X}sub{e.sub:X}")
    return out


def eds(p: Protocol) -> str:
    """The object dictionary as an electronic data sheet."""
    d = p.device
    out = [
        "[FileInfo]", f"FileName={p.key}.eds", "FileVersion=1", "FileRevision=0", "EDSVersion=4.0",
        f"Description={p.generated}", "CreationTime=12:00AM", "CreationDate=01-01-2026", "CreatedBy=psabench",
        "ModificationTime=12:00AM", "ModificationDate=01-01-2026", "ModifiedBy=psabench", "",
        "[DeviceInfo]", "VendorName=psabench", f"VendorNumber=0x{d['vendor_id']:X}", f"ProductName={d['name']}",
        f"ProductNumber=0x{d['product_code']:X}", f"RevisionNumber=0x{d['revision']:X}", "OrderCode=",
        *(f"BaudRate_{k}={int(k in (125, 250, 500, 800, 1000))}" for k in (10, 20, 50, 125, 250, 500, 800, 1000)),
        "SimpleBootUpMaster=0", "SimpleBootUpSlave=1", "Granularity=0", "DynamicChannelsSupported=0",
        "GroupMessaging=0", "NrOfRXPDO=0", f"NrOfTXPDO={len(p.tpdos)}", "LSS_Supported=0", "",
        "[DummyUsage]", *(f"Dummy{k:04X}=0" for k in range(1, 8)), "",
    ]  # fmt: skip
    mandatory = (0x1000, 0x1001, 0x1018)
    groups = {
        "MandatoryObjects": [o for o in p.objects if o.index in mandatory],
        "OptionalObjects": [o for o in p.objects if o.index not in mandatory and not 0x2000 <= o.index < 0x6000],
        "ManufacturerObjects": [o for o in p.objects if 0x2000 <= o.index < 0x6000],
    }
    for name, objects in groups.items():
        out += [f"[{name}]", f"SupportedObjects={len(objects)}"]
        out += [f"{k}=0x{o.index:X}" for k, o in enumerate(objects, 1)] + [""]
        for o in objects:
            out += eds_object(p, o)
    return "\n".join(out)
