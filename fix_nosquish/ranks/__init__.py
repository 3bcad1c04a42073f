"""Bodies and ranks of a run: which ranks share a body, and what goes with atoms that leave."""
