"""Surface: what lies on bead and plate: spatter, gaps, craters, candidates, laser profiles."""
