"""The imperative shell: sockets, threads, effects. It alone knows both control and hal."""
