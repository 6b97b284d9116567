import pyvisa
from pyvisa.resources import TCPIPSocket

head = pyvisa.ResourceManager("@py").open_resource(
    "TCPIP::127.0.0.1::5025::SOCKET", read_termination="\n", write_termination="\n"
)
assert isinstance(head, TCPIPSocket)  # for type checkers
print(head.query("*IDN?"))
head.write("ANGLe 90 DEG")
print("at rest:", head.query("*OPC?"))
print("angle, face:", head.query("ANGLe?;FACE?"))
head.write("ANGLe 2 V")
print(head.query("SYSTem:ERRor?"))
