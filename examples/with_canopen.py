"""python-canopen, unmodified, against psa-emu: `build/psa-emu stream` first."""

import canopen

network = canopen.Network()
network.connect(interface="socketcand", channel="can0", host="127.0.0.1", port=29536, tcp_tune=True)
node = network.add_node(5, "proto/psa2.eds")
print("name     ", node.sdo["Manufacturer device name"].raw)
node.tpdo[1].read()
node.tpdo[1].wait_for_reception()  # the first frame: the set-up after Res is done, registers can be read
print("X in PDO ", f"{node.tpdo[1]['Latest codes.Code X'].raw * 10 / 2**23:.2f} V")
print("CONFIG0  ", f"{node.sdo['Accelerometer converter X']['CONFIG0'].raw:02X}h")
try:
    node.sdo["Accelerometer converter X"]["ID"].raw = 0
except canopen.SdoAbortedError as e:
    print("write ID ", e)
network.disconnect()
