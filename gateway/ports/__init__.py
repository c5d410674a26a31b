"""Bytes come in: serial ports, sockets, files, and who keeps them open."""
