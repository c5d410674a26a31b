"""Alarms: what is wrong, in levels and states, kept, told to people, whether or not a page is open.

`gyrofree alarms` is a process of its own, so that it goes on when the page does not. It lies beside
dashboard/data because it judges by the same store and the same list of faults as the page: two
readers of the bus could say two things. What it finds goes back onto the bus (topic alarm).
"""
