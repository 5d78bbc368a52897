//! Messages of numbers as JSON, and what each topic's messages look like: their schemas.

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::wire::descriptor_set;
use super::{Contact, Joint, types};

/// A time as Foxglove writes it in JSON.
#[derive(Serialize)]
pub struct Time {
    sec: u64,
    nsec: u64,
}

impl Time {
    /// So many nanoseconds.
    pub fn of(nanoseconds: u64) -> Self {
        Self { sec: nanoseconds / 1_000_000_000, nsec: nanoseconds % 1_000_000_000 }
    }
}

/// Numbers by name, in their order.
pub struct Named<'a>(pub &'a [(&'a str, f64)]);

impl Serialize for Named<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in self.0 {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }
}

/// `foxglove.JointStates`.
#[derive(Serialize)]
pub struct JointStates<'a> {
    /// When.
    pub timestamp: Time,
    /// All joints.
    pub joints: &'a [Joint<'a>],
}

/// A number for each channel.
#[derive(Serialize)]
pub struct Channels<'a> {
    /// When.
    pub timestamp: Time,
    /// By channel.
    #[serde(flatten)]
    pub values: Named<'a>,
}

/// Bodies that touch.
#[derive(Serialize)]
pub struct Contacts<'a> {
    /// When.
    pub timestamp: Time,
    /// All pairs.
    pub contacts: &'a [Contact<'a>],
}

/// Something that happened.
#[derive(Serialize)]
pub struct Event<'a> {
    /// When.
    pub timestamp: Time,
    /// What.
    pub name: &'a str,
    /// Numbers that belong to it.
    pub values: Named<'a>,
}

/// The begin of a sequence.
#[derive(Serialize)]
pub struct Sequence<'a> {
    /// When.
    pub timestamp: Time,
    /// What it is called.
    pub name: &'a str,
}

/// A message as bytes.
pub fn bytes(message: &impl Serialize) -> Vec<u8> {
    text(message).into_bytes()
}

/// A message as text.
pub fn text(message: &impl Serialize) -> String {
    serde_json::to_string(message).expect("strings and numbers by name become JSON")
}

/// What the messages of a topic look like.
pub struct Schema {
    /// A viewer knows the message by it.
    pub name: &'static str,
    /// `jsonschema` or `protobuf`.
    pub encoding: &'static str,
    /// `json` or `protobuf`.
    pub message_encoding: &'static str,
    /// The schema itself.
    pub data: Vec<u8>,
}

impl Schema {
    /// The schema of a recording's topic.
    pub fn of(topic: &str, channels: &[String]) -> Self {
        let number = || json!({ "type": "number" });
        let text = || json!({ "type": "string" });
        let number_by_channel = || channels.iter().map(|name| (name.clone(), number())).collect::<Vec<_>>();
        let pairs =
            |pairs: Vec<(&str, Value)>| pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        let array = |title: &str, fields: Vec<(&str, Value)>, required: &[&str]| json!({ "type": "array", "items": object(title, pairs(fields), required) });
        match topic {
            "/scene" => {
                let files = [&types::TIMESTAMP_FILE, &types::DURATION_FILE, &types::GEOMETRY_FILE, &types::SCENE_FILE];
                Self::protobuf("foxglove.SceneUpdate", descriptor_set(&files))
            }
            "/transforms" => {
                let files = [&types::TIMESTAMP_FILE, &types::GEOMETRY_FILE, &types::TRANSFORMS_FILE];
                Self::protobuf("foxglove.FrameTransforms", descriptor_set(&files))
            }
            "/joint_states" | "/joint_targets" => {
                let fields = ["position", "velocity", "acceleration", "effort"];
                let fields = [("name", text())].into_iter().chain(fields.map(|name| (name, number())));
                let joints = array("foxglove.JointState", fields.collect(), &["name"]);
                Self::json("foxglove.JointStates", vec![("joints".to_owned(), joints)], &["joints"])
            }
            "/contacts" => {
                let fields = vec![("a", text()), ("b", text()), ("distance", number()), ("force", number())];
                let contacts = array("scrnn.Contact", fields, &["a", "b"]);
                Self::json("scrnn.Contacts", vec![("contacts".to_owned(), contacts)], &["contacts"])
            }
            "/events" => {
                let values = json!({ "type": "object", "additionalProperties": number() });
                Self::json("scrnn.Event", pairs(vec![("name", text()), ("values", values)]), &["name", "values"])
            }
            "/sequence" => Self::json("scrnn.Sequence", pairs(vec![("name", text())]), &["name"]),
            _ => {
                let required: Vec<&str> = channels.iter().map(String::as_str).collect();
                Self::json("scrnn.Channels", number_by_channel(), &required)
            }
        }
    }

    fn protobuf(name: &'static str, data: Vec<u8>) -> Self {
        Self { name, encoding: "protobuf", message_encoding: "protobuf", data }
    }

    /// An object of these fields besides its timestamp.
    fn json(name: &'static str, fields: Vec<(String, Value)>, required: &[&str]) -> Self {
        let whole = json!({ "type": "integer", "minimum": 0 });
        let below = json!({ "type": "integer", "minimum": 0, "maximum": 999_999_999 });
        let time = json!({ "type": "object", "title": "time", "properties": { "sec": whole, "nsec": below } });
        let fields = [("timestamp".to_owned(), time)].into_iter().chain(fields).collect();
        let required: Vec<&str> = ["timestamp"].iter().chain(required).copied().collect();
        let data = object(name, fields, &required).to_string().into_bytes();
        Self { name, encoding: "jsonschema", message_encoding: "json", data }
    }
}

fn object(title: &str, fields: Vec<(String, Value)>, required: &[&str]) -> Value {
    let properties: serde_json::Map<String, Value> = fields.into_iter().collect();
    json!({ "title": title, "type": "object", "properties": properties, "required": required })
}
