from psabench import Bench

with Bench.start("quiet") as bench:  # starts an emulator; its time moves when we wait
    bench.unit.wait_ready()
    print(f"CONFIG0 = {bench.unit.register('x', 'CONFIG0'):02X}h")
    for angle_deg in (0, 90, 270):
        bench.head.turn(angle_deg)  # an instrument over SCPI
        bench.wait(0.1)  # the filters settle
        print(f"{angle_deg:3d} deg: {bench.unit.stream(1).axis('x')[0]:.6f} V")
