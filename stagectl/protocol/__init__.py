"""What a stage server and its clients say to each other: models, their encoding, where they meet.

`requests` (what a client can ask for), `state` (what the server publishes), `wire` (msgpack frames
with versions, sample blocks as raw arrays), `endpoint` (sockets in the runtime folder). The schemas
of all messages are in docs/formats/server.md.
"""
