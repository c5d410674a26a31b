"""The live picture: a viser server with the 3-D scene and the docked panels, fed from the bus.

palette   colours that a colour-blind person can tell apart, number formats
store     latest values and ring buffers per device
feed      Zenoh subscriptions into the store
series    decimation of many samples to few points, gap masks
chart     one uPlot chart with its live legend
geometry  cube, vehicle, table; n to display; WGS-84 to local north-east-down
scene     the nodes of the 3-D scene of one browser
view      panels and controls of one browser
service   start(): server, feed and the two update loops
"""
