"""How a block of bodies moves: the rotors, the operations of a splitting, and random numbers."""
