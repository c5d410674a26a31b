"""The bus: contract, topics and session. Frames, units and quaternion order are stated in
gyrofree.proto.
"""
