"""Decode a message with the descriptors that stand in the MCAP file, as any foreign reader does."""

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader


def decoded(path, topic):
    """The first message of a topic."""
    with path.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages(topics=[topic]):
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            pool = descriptor_pool.DescriptorPool()
            for file in files.file:
                pool.Add(file)
            type_ = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            return type_.FromString(message.data)
    return None
