"""Scenes, spoilt pictures and the whole chain, for the benches of vision."""
