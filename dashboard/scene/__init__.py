"""The live picture: a viser server with the 3-D scene and the docked panels, of dashboard/data.

drawing/  shapes, colours, number formats, charts and their decimation
panels/   one module for each page of charts and each box on the left
scene     the nodes of the 3-D scene of one browser
view      panels and controls of one browser
service   start(): server, feed and the two update loops
"""
