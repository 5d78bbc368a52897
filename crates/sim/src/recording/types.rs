//! The types of Foxglove's messages that a recording uses, field by field. Names and numbers are Foxglove's.
//!
//! A viewer expects all fields of a type, so also those stand here that are never filled.

use super::wire::{FieldType, Kind, MessageType, TypeFile};

use Kind::{Bool, Bytes, Double, Fixed32, Int32, Int64, Of, OneOf, Text};

const fn one(name: &'static str, number: u32, kind: Kind) -> FieldType {
    FieldType { name, number, kind, repeated: false }
}

const fn list(name: &'static str, number: u32, kind: Kind) -> FieldType {
    FieldType { name, number, kind, repeated: true }
}

const fn message(name: &'static str, fields: &'static [FieldType]) -> MessageType {
    MessageType { name, fields, variants: &[] }
}

const TIME: Kind = Of("google.protobuf.Timestamp");
const DURATION: Kind = Of("google.protobuf.Duration");
const VECTOR: Kind = Of("foxglove.Vector3");
const QUATERNION: Kind = Of("foxglove.Quaternion");
const POINT: Kind = Of("foxglove.Point3");
const POSE: Kind = Of("foxglove.Pose");
const COLOR: Kind = Of("foxglove.Color");

/// `google.protobuf.Timestamp`.
pub const TIMESTAMP_FILE: TypeFile = TypeFile {
    path: "google/protobuf/timestamp.proto",
    package: "google.protobuf",
    imports: &[],
    types: &[message("Timestamp", &[one("seconds", 1, Int64), one("nanos", 2, Int32)])],
};

/// `google.protobuf.Duration`.
pub const DURATION_FILE: TypeFile = TypeFile {
    path: "google/protobuf/duration.proto",
    package: "google.protobuf",
    imports: &[],
    types: &[message("Duration", &[one("seconds", 1, Int64), one("nanos", 2, Int32)])],
};

/// What transforms and scenes are made of.
pub const GEOMETRY_FILE: TypeFile = TypeFile {
    path: "foxglove/Geometry.proto",
    package: "foxglove",
    imports: &[],
    types: &[
        message("Vector3", &[one("x", 1, Double), one("y", 2, Double), one("z", 3, Double)]),
        message("Point3", &[one("x", 1, Double), one("y", 2, Double), one("z", 3, Double)]),
        message("Quaternion", &[one("x", 1, Double), one("y", 2, Double), one("z", 3, Double), one("w", 4, Double)]),
        message("Pose", &[one("position", 1, VECTOR), one("orientation", 2, QUATERNION)]),
        message("Color", &[one("r", 1, Double), one("g", 2, Double), one("b", 3, Double), one("a", 4, Double)]),
    ],
};

/// `foxglove.FrameTransforms`.
pub const TRANSFORMS_FILE: TypeFile = TypeFile {
    path: "foxglove/FrameTransforms.proto",
    package: "foxglove",
    imports: &[TIMESTAMP_FILE.path, GEOMETRY_FILE.path],
    types: &[
        message(
            "FrameTransform",
            &[
                one("timestamp", 1, TIME),
                one("parent_frame_id", 2, Text),
                one("child_frame_id", 3, Text),
                one("translation", 4, VECTOR),
                one("rotation", 5, QUATERNION),
            ],
        ),
        message("FrameTransforms", &[list("transforms", 1, Of("foxglove.FrameTransform"))]),
    ],
};

/// `foxglove.SceneUpdate`.
pub const SCENE_FILE: TypeFile = TypeFile {
    path: "foxglove/SceneUpdate.proto",
    package: "foxglove",
    imports: &[TIMESTAMP_FILE.path, DURATION_FILE.path, GEOMETRY_FILE.path],
    types: &[
        message("KeyValuePair", &[one("key", 1, Text), one("value", 2, Text)]),
        message(
            "ArrowPrimitive",
            &[
                one("pose", 1, POSE),
                one("shaft_length", 2, Double),
                one("shaft_diameter", 3, Double),
                one("head_length", 4, Double),
                one("head_diameter", 5, Double),
                one("color", 6, COLOR),
            ],
        ),
        message("CubePrimitive", &[one("pose", 1, POSE), one("size", 2, VECTOR), one("color", 3, COLOR)]),
        message("SpherePrimitive", &[one("pose", 1, POSE), one("size", 2, VECTOR), one("color", 3, COLOR)]),
        message(
            "CylinderPrimitive",
            &[
                one("pose", 1, POSE),
                one("size", 2, VECTOR),
                one("bottom_scale", 3, Double),
                one("top_scale", 4, Double),
                one("color", 5, COLOR),
            ],
        ),
        MessageType {
            name: "LinePrimitive",
            fields: &[
                one("type", 1, OneOf("foxglove.LinePrimitive.Type")),
                one("pose", 2, POSE),
                one("thickness", 3, Double),
                one("scale_invariant", 4, Bool),
                list("points", 5, POINT),
                one("color", 6, COLOR),
                list("colors", 7, COLOR),
                list("indices", 8, Fixed32),
            ],
            variants: &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"],
        },
        message(
            "TriangleListPrimitive",
            &[
                one("pose", 1, POSE),
                list("points", 2, POINT),
                one("color", 3, COLOR),
                list("colors", 4, COLOR),
                list("indices", 5, Fixed32),
            ],
        ),
        message(
            "TextPrimitive",
            &[
                one("pose", 1, POSE),
                one("billboard", 2, Bool),
                one("font_size", 3, Double),
                one("scale_invariant", 4, Bool),
                one("color", 5, COLOR),
                one("text", 6, Text),
            ],
        ),
        message(
            "ModelPrimitive",
            &[
                one("pose", 1, POSE),
                one("scale", 2, VECTOR),
                one("color", 3, COLOR),
                one("override_color", 4, Bool),
                one("url", 5, Text),
                one("media_type", 6, Text),
                one("data", 7, Bytes),
            ],
        ),
        MessageType {
            name: "SceneEntityDeletion",
            fields: &[
                one("timestamp", 1, TIME),
                one("type", 2, OneOf("foxglove.SceneEntityDeletion.Type")),
                one("id", 3, Text),
            ],
            variants: &["MATCHING_ID", "ALL"],
        },
        message(
            "SceneEntity",
            &[
                one("timestamp", 1, TIME),
                one("frame_id", 2, Text),
                one("id", 3, Text),
                one("lifetime", 4, DURATION),
                one("frame_locked", 5, Bool),
                list("metadata", 6, Of("foxglove.KeyValuePair")),
                list("arrows", 7, Of("foxglove.ArrowPrimitive")),
                list("cubes", 8, Of("foxglove.CubePrimitive")),
                list("spheres", 9, Of("foxglove.SpherePrimitive")),
                list("cylinders", 10, Of("foxglove.CylinderPrimitive")),
                list("lines", 11, Of("foxglove.LinePrimitive")),
                list("triangles", 12, Of("foxglove.TriangleListPrimitive")),
                list("texts", 13, Of("foxglove.TextPrimitive")),
                list("models", 14, Of("foxglove.ModelPrimitive")),
            ],
        ),
        message(
            "SceneUpdate",
            &[
                list("deletions", 1, Of("foxglove.SceneEntityDeletion")),
                list("entities", 2, Of("foxglove.SceneEntity")),
            ],
        ),
    ],
};
