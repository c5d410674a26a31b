"""Bytes of a board become samples on the bus. A byte passes, in this order:

    ports/reader.py       read from the port, written to the journal, queued
    board/device.py       taken from the queue by the loop of its board
    board/decoder.py      bytes to frames, all accounted for
    board/frames.py       each frame to those whom it concerns
    samples/flow.py       sample frames to batches in SI units, with their place since boot
    samples/tacho_flow.py, gnss/flow.py     pulses and receivers' bytes to rates and fixes
    board/outgoing.py     a message gets its header and goes to the bus and the spool

Beside the way stand time/ (device time to UTC), board/watch.py (what is wrong), board/orders.py
(orders to the board) and board/link_report.py (what the line delivered).
"""
