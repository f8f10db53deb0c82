"""legato: an unattended daemon for a leg-massage robot cell.

Importing the package does nothing: no handler, thread, file or device.
"""

__version__ = "0.1.0"
