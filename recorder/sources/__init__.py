"""Sources that a recording can be made from: cameras, encoders, replayed files."""
