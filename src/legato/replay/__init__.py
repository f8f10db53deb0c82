"""A record drives its procedure again, and must come to the same decisions.

Pictures, registers and contacts come from the record; marks, calibration, tests, paths and limits
are worked out anew.
"""
