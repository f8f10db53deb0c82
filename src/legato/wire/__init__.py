"""Bytes to messages and back, without I/O: JSON-RPC 2.0 and the TeachMover's serial protocol."""
