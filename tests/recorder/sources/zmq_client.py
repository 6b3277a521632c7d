"""A loop in another process that sends all forms of the wire format; run with ADDRESS."""

import json
import struct
import sys

import zmq


def main(address: str) -> None:
    """Send, some of it nonsense, and end."""
    with zmq.Context() as context, context.socket(zmq.PUSH) as socket:
        socket.connect(address)
        for step in range(500):
            numbers = struct.pack("<q2d", 1_000_000 * (step + 1), step / 1000, 0.5)
            socket.send_multipart([b"/table/encoder", numbers])
        fields = {"stamp_ns": 77, "command": 3.0, "saturated": True}
        socket.send_multipart([b"json /table/command", json.dumps(fields).encode()])
        socket.send_multipart([b"json /seam/points", b'{"x_px": [1.0, 2.0], "y_px": [3.0, 4.0]}'])
        socket.send_multipart([b"/events", struct.pack("<qd", 5, 1.0), "Zündung".encode()])
        socket.send_multipart([b"/camera/image", struct.pack("<q", 9), b"\xff\xd8\xff\xe0jpeg"])
        socket.send_multipart([b"/no/such", b"12345678"])
        socket.send_multipart([b"/table/encoder", b"123"])
        socket.send_multipart([b"json /table/encoder", b"[[[["])
        socket.send(b"end")


if __name__ == "__main__":
    main(sys.argv[1])
