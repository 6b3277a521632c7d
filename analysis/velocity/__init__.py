"""Velocity from sampled position: causal ones for loops, smoothers for what was recorded."""
