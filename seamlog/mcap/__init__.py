"""The MCAP codec: columnar reader, batch writer, message packing and attachments."""
