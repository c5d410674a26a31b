"""What the dashboard knows: messages become rows of declared tables, one store for scene and pages.

feed      the bus into the store, late and older messages too
store     all devices, the recorder, the replay
device    one device: newest messages, rings, tracks
intake    which field of which message is which column
tables    the columns: name, unit, shape
"""
