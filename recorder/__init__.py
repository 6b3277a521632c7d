"""The live side: control loop to ring to session file, recovery, sources and importers."""
