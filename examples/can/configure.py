"""Configure a PSA-2 over CANopen with python-canopen: frame form, SYNC mode, heartbeat; then start it."""

import can
import canopen

NODE = 5

network = canopen.Network()
network.connect()  # the interface of python-can: CAN_INTERFACE, CAN_CHANNEL, CAN_CONFIG
node = network.add_node(NODE, "proto/psa2.eds")
node.sdo.RESPONSE_TIMEOUT = 2.0
try:
    print("device   ", node.sdo["Manufacturer device name"].raw)
    node.nmt.state = "PRE-OPERATIONAL"  # a PDO may be set up only while it is not sent
    node.sdo["Producer heartbeat time"].raw = 500  # ms
    node.sdo["Frame form"].raw = 1  # three codes in one message: half the bus load
    for name in ("Frame form", "Sample mode", "Sample every N-th frame", "Producer heartbeat time"):
        print(f"{name:24} {node.sdo[name].raw}")
    node.nmt.state = "OPERATIONAL"
    assert network.bus is not None  # for type checkers
    message = can.Message()
    while message.arbitration_id != 0x380 + NODE:  # PSA2_FAST
        message = network.bus.recv(2.0) or message
    print("stream   ", f"{message.arbitration_id:X}h", message.data.hex(" "))
    node.nmt.state = "PRE-OPERATIONAL"
    node.sdo["Frame form"].raw = 0  # as it was
    node.nmt.state = "OPERATIONAL"
finally:
    network.disconnect()
