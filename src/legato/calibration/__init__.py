"""From marks in a picture to camera and pose: cost, genetic search, refinement, uncertainty.

Pure: randomness comes in as a numpy Generator; no clock, file or thread.
"""
