"""Tests of what is shipped: packages, entry points, wheel, start-up."""
