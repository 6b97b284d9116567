"""UBX-NAV-PVT as pyubx2 writes it, which does not know of our reader."""

from __future__ import annotations

from pyubx2 import GET, UBXMessage


def pvt(
    tow_ms: int, *, fix: int = 3, lat: float = 55.7, lon: float = -37.5, v_mms: tuple[int, int, int] = (1, 2, 3)
) -> bytes:
    """A packet; v_mms: north, east, down."""
    north, east, down = v_mms
    message = UBXMessage(
        "NAV",
        "NAV-PVT",
        GET,
        iTOW=tow_ms,
        fixType=fix,
        gnssFixOk=int(fix > 0),
        lat=lat,
        lon=lon,
        height=150_123,
        velN=north,
        velE=east,
        velD=down,
    )
    raw: bytes = message.serialize()
    return raw
