"""Figures of speed, accuracy and endurance: `make bench`, or `python -m bench NAME...` for some."""
