"""The virtual weld cell: the paper's rig with known truth, as a recording source."""
