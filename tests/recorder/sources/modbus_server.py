"""A drive that speaks Modbus RTU; run as `python modbus_server.py PORT`."""

import asyncio
import struct
import sys

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice


async def serve(port: str) -> None:
    """Answer until killed."""
    words = list(struct.unpack(">3H", struct.pack(">ih", -123_456, 1500)))
    data = SimData(100, values=words, datatype=DataType.REGISTERS)
    server = ModbusSerialServer(
        SimDevice(7, [data]), framer=FramerType.RTU, port=port, baudrate=115_200
    )
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1]))
