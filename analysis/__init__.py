"""Sessions to results: pure functions without plots or printing."""
