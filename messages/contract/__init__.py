"""What crosses the bus: protobuf messages and the table of topics."""
