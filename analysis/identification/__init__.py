"""Identification: inertia and friction of the axis from logged motion and commands, with doubt."""
