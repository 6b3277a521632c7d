"""Results to one self-contained HTML report."""
