from psabench import open_rig

with open_rig("quiet") as rig:  # starts an emulator; its time moves when we wait
    rig.unit.wait_ready()
    print(f"CONFIG0 = {rig.unit.register('x', 1):02X}h")
    for angle_deg in (0, 90, 270):
        rig.control.call("head.turn", angle_deg=angle_deg)
        rig.host.advance(0.1)  # the filters settle
        print(f"{angle_deg:3d} deg: {rig.unit.stream(1).axis('x')[0]:.6f} V")
