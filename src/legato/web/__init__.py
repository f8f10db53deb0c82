"""The live page: a process of its own, an ordinary client of the daemon, served on loopback alone.

It reads the daemon's lines and the records on disk, writes neither, and acts only for who holds
its token. However many pages are open, the daemon sees one subscriber.
"""
