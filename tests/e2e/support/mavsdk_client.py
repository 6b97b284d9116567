"""MAVSDK as a ground station: what it reads from a MAVLink system at udpin://127.0.0.1:PORT, as one line of JSON.

Usage: mavsdk_client.py PORT telemetry|params|calibrate [NAME VALUE]. A process of its own: MAVSDK has native threads.
"""

from __future__ import annotations

import asyncio
import json
import sys
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.calibration import CalibrationAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

FIND_S = 30.0


async def telemetry(system: Any, _: list[str]) -> dict[str, Any]:
    """Acceleration and attitude, ten of the first and one of the second."""
    plugin = TelemetryAsync(system)
    imu = []
    async for sample in plugin.subscribe_imu():
        a = sample.acceleration_frd
        imu.append([a.forward_m_s2, a.right_m_s2, a.down_m_s2])
        if len(imu) == 10:
            break
    async for euler in plugin.subscribe_attitude_euler():
        return {"imu": imu, "euler_deg": [euler.roll_deg, euler.pitch_deg, euler.yaw_deg]}
    return {}


async def params(system: Any, words: list[str]) -> dict[str, Any]:
    """All parameters, then one that is set and read again."""
    plugin = ParamAsync(system)
    every = await plugin.get_all_params()
    await plugin.set_param_float(words[0], float(words[1]))
    return {
        "float": {p.name: p.value for p in every.float_params},
        "int": {p.name: p.value for p in every.int_params},
        "again": await plugin.get_param_float(words[0]),
    }


async def calibrate(system: Any, _: list[str]) -> dict[str, Any]:
    """The accelerometer; progress in percent, and the exception that ends it, if one does."""
    progress: list[float] = []
    try:
        async for _result, step in CalibrationAsync(system).calibrate_accelerometer():
            if step.has_progress:
                progress.append(step.progress)
    except Exception as e:
        return {"progress": progress, "error": str(e)}
    return {"progress": progress, "error": ""}


async def main(words: list[str]) -> None:
    what = {"telemetry": telemetry, "params": params, "calibrate": calibrate}[words[1]]
    config = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(config) as sdk:
        await sdk.add_any_connection(f"udpin://127.0.0.1:{words[0]}")
        system = await sdk.first_autopilot(timeout_s=FIND_S)
        print(json.dumps({"found": False} if system is None else {"found": True} | await what(system, words[2:])))


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1:]))
