"""The report's figures: each function takes data and gives an SVG picture as a data URI.

matplotlib's objects only: no pyplot, no settings changed.
"""
