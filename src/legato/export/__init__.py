"""Records as files that other tools open: MCAP, Parquet, CSV, and the arm as URDF.

Reads records and configurations and nothing else; what a file format needs is imported where it
is written. Everything that is written is in metres and rad, as those tools expect.
"""
