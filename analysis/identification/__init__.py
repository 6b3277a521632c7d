"""Identification of inertia and friction from recorded motion, with uncertainty."""
