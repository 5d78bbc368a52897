#!/usr/bin/env python3
"""Reads a recording of a simulation with the packages mcap, mcap-protobuf-support and foxglove-schemas-protobuf.

  read_recording.py FILE

Checks that the file is whole, that JSON messages are as their schemas say, that protobuf messages decode with the
descriptions in the file and with Foxglove's own, to the same, and prints what it holds as JSON.

Exit code 0: all is as it should be. 1: it is not.
"""

import json
import sys
from math import isclose

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.json_format import MessageToDict
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

OWN = {"foxglove.FrameTransforms": FrameTransforms, "foxglove.SceneUpdate": SceneUpdate}

# The fields of the JSON form, for which there is no package: names as in Foxglove's documentation.
JOINT = {"name", "position", "velocity", "acceleration", "effort"}


def fields(descriptor, seen):
    """All message types below a descriptor: name -> its fields with number, type and whether it is a list."""
    if descriptor.full_name not in seen:
        seen[descriptor.full_name] = {
            (f.name, f.number, f.type, f.is_repeated, f.enum_type and tuple(f.enum_type.values_by_name))
            for f in descriptor.fields
        }
        for field in descriptor.fields:
            if field.message_type:
                fields(field.message_type, seen)
    return seen


def check_json(topic, message, schema):
    """A message against the part of JSON schema that the recording uses."""
    kinds = {"object": dict, "array": list, "string": str, "number": (int, float), "integer": int}
    if not isinstance(message, kinds[schema["type"]]):
        sys.exit(f"{topic}: {message!r} is no {schema['type']}")
    for name in schema.get("required", []):
        if name not in message:
            sys.exit(f"{topic}: {name} is missing in {message}")
    if isinstance(message, dict):
        for name, value in message.items():
            one = schema["properties"].get(name) if "properties" in schema else schema["additionalProperties"]
            if one is None:
                sys.exit(f"{topic}: the schema does not know {name}")
            check_json(topic, value, one)
    if isinstance(message, list):
        for value in message:
            check_json(topic, value, schema["items"])


def main():
    factory = DecoderFactory()
    counts, last = {}, {}
    with open(sys.argv[1], "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        attachments = {one.name: one.data.decode() for one in reader.iter_attachments()}
        for schema, channel, message in reader.iter_messages():
            if schema.encoding == "jsonschema":
                description, value = json.loads(schema.data), json.loads(message.data)
                check_json(channel.topic, value, description)
                time = value["timestamp"]["sec"] * 10**9 + value["timestamp"]["nsec"]
                if schema.name == "foxglove.JointStates":
                    known = set(description["properties"]["joints"]["items"]["properties"])
                    if known != JOINT:
                        sys.exit(f"{channel.topic}: joints have the fields {known}")
            else:
                decoded = factory.decoder_for(channel.message_encoding, schema)(message.data)
                own = OWN[schema.name].FromString(message.data)
                if own.SerializeToString(deterministic=True) != decoded.SerializeToString(deterministic=True):
                    sys.exit(f"{channel.topic}: Foxglove's own schema reads something else")
                if fields(own.DESCRIPTOR, {}) != fields(decoded.DESCRIPTOR, {}):
                    sys.exit(f"{channel.topic}: the file's description is not Foxglove's")
                value = MessageToDict(own, preserving_proto_field_name=True)
                first = (own.transforms if schema.name == "foxglove.FrameTransforms" else own.entities)[0]
                time = first.timestamp.seconds * 10**9 + first.timestamp.nanos
                for place in own.transforms if schema.name == "foxglove.FrameTransforms" else []:
                    norm = sum(getattr(place.rotation, axis) ** 2 for axis in "xyzw")
                    if not isclose(norm, 1.0, abs_tol=1e-9):
                        sys.exit(f"{channel.topic}: {place.child_frame_id} is rotated by {place.rotation}")
            if time != message.log_time:
                sys.exit(f"{channel.topic}: {time} ns in the message, {message.log_time} ns in the file")
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            last[channel.topic] = value
    print(json.dumps({"attachments": attachments, "counts": counts, "last": last}))


if __name__ == "__main__":
    main()
