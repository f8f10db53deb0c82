"""Poses, the leg, projection, the arm's kinematics and paths.

Pure: numbers in, numbers out. Units are mm, rad and px throughout.
"""
