"""The simulated cell: one world shared by its arm and its camera."""
