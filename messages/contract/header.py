"""Of a message of ours only the header, which stands first: parsing the whole would cost more than
passing it on.
"""


def first_field(payload: bytes) -> bytes:
    """Content of field 1 when it stands first and is length-delimited; raises ValueError
    otherwise.
    """
    if len(payload) < 2 or payload[0] != 0x0A:
        raise ValueError("field 1 does not stand first")
    size, at, shift = payload[1] & 0x7F, 2, 7
    while payload[at - 1] & 0x80:
        if at >= len(payload) or at > 4:
            raise ValueError("length of field 1 does not end")
        size |= (payload[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    if at + size > len(payload):
        raise ValueError("field 1 is longer than the message")
    return payload[at : at + size]
