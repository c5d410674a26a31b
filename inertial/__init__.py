"""The mathematics: sensors to motion, numpy in and numpy out. Knows no bus, no wire, no time of
day.
"""
