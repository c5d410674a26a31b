"""Which setting do the data contradict? One mechanism for live boards and for logs.

watch     samples and tachometer reports become quiet windows and plateaus
ratio     pulses per revolution or half side: whose number would fit
axes      axes of a cube swapped, turned or of the wrong sign: which wiring would fit
"""
