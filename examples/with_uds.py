"""udsoncan over can-isotp, both unmodified, against a unit with a UDS door (docs/tools/uds.md): start psa-emu first."""

import time
from typing import Any

import can
import isotp
from udsoncan import AsciiCodec
from udsoncan.client import Client
from udsoncan.connections import PythonIsoTpV2Connection
from udsoncan.exceptions import NegativeResponseException

NAME, SERIAL, CONFIG0, REMARK = 0xF197, 0xF18C, 0x2002, 0x3000
CODECS = {NAME: AsciiCodec(5), SERIAL: "<I", CONFIG0: "<B", REMARK: AsciiCodec(16)}
CONDITIONS_NOT_CORRECT, EXTENDED = 0x22, 3

bus = can.Bus(interface="socketcand", channel="can0", host="127.0.0.1", port=29536, tcp_tune=True)
notifier = can.Notifier(bus, [])
address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=0x7E0, rxid=0x7E8)
stack = isotp.NotifierBasedCanStack(bus, notifier, address=address, params={"tx_padding": 0xCC})


def read(client: Client, did: int) -> Any:
    """The value; again while the unit is being set up."""
    while True:
        try:
            return client.read_data_by_identifier([did]).service_data.values[did]
        except NegativeResponseException as e:
            if e.response.code != CONDITIONS_NOT_CORRECT:
                raise
            time.sleep(0.05)


with Client(PythonIsoTpV2Connection(stack), request_timeout=5) as client:
    client.set_configs({"data_identifiers": CODECS, "p2_timeout": 2})
    client.logger.disabled = True
    print("name     ", read(client, NAME))
    print("serial   ", read(client, SERIAL)[0])
    print("CONFIG0  ", f"{read(client, CONFIG0)[0]:02X}h")
    try:
        client.write_data_by_identifier(REMARK, "sixteen letters.")
    except NegativeResponseException as e:
        print("write    ", e.response.code_name)
    client.change_session(EXTENDED)
    client.write_data_by_identifier(REMARK, "sixteen letters.")
    print("remark   ", read(client, REMARK))
    print("DTCs     ", client.get_number_of_dtc_by_status_mask(0xFF).service_data.dtc_count)
notifier.stop()
bus.shutdown()
