"""What a driver implements: an arm, a camera, a clock. Protocols, their data and their errors."""
