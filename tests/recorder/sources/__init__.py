"""Sources recorded for real: pty lines, a Modbus server, virtual cameras, video, ZeroMQ."""
