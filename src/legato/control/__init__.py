"""Decisions: the state table, the jobs as generators of effects, the safety envelope, verify.

Pure: what has to be done is yielded as an effect and its result sent back in.
"""
