"""The session store: what was asked, what happened, and how it ended, on disk.

Nothing accepted is without an outcome; what is written is never rewritten save as a whole.
"""
