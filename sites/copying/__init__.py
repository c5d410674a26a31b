"""Recordings of the home, copied to another place until both are provably equal.

    shelf.py      what there is: files of sessions as segments, each named by its content
    serving.py    home's end: lists and segments, as answers to questions
    fetching.py   the other end: asks for what differs, newest session first, and proves the copy

Why not Zenoh's own storages: their replication keeps the latest value of a key and refuses
everything else. A segment is such a value, as its key holds its hash; but a storage would keep a
second copy of every recording at home, and knows nothing of what is wanted first. So segments are
read from the recordings themselves when they are asked for.
"""
