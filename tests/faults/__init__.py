"""The fault programme: what the recorder keeps when processes, disks and clocks fail."""
