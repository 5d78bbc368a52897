//! From the bytes of a message to its tree, by what the recording says of the message's channel.

use std::rc::Rc;

use super::message::{Channel, Schema};
use super::numbers::Manner;
use super::protobuf::{self, Descriptors};
use super::ros::{self, cdr, definition::Definition};
use super::tree::{self, Tree};

/// Types that hold no movements: pictures, words, the system's own affairs.
const NO_MOVEMENTS: [&str; 22] = [
    "sensor_msgs/Image",
    "sensor_msgs/CompressedImage",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/PointCloud",
    "sensor_msgs/PointCloud2",
    "rosgraph_msgs/Clock",
    "std_msgs/String",
    "std_msgs/Empty",
    "std_msgs/Header",
    "nav_msgs/OccupancyGrid",
    "nav_msgs/Path",
    "visualization_msgs/Marker",
    "visualization_msgs/MarkerArray",
    "foxglove.CompressedImage",
    "foxglove.CompressedVideo",
    "foxglove.RawImage",
    "foxglove.PointCloud",
    "foxglove.Log",
    "foxglove.SceneUpdate",
    "foxglove.CameraCalibration",
    "foxglove.Grid",
    "foxglove.LaserScan",
];
/// Packages that hold none.
const NO_MOVEMENTS_IN: [&str; 8] = [
    "rcl_interfaces/",
    "diagnostic_msgs/",
    "lifecycle_msgs/",
    "action_msgs/",
    "statistics_msgs/",
    "rmw_dds_common/",
    "rosbag2_interfaces/",
    "service_msgs/",
];
/// Topics that hold none.
const NO_MOVEMENTS_ON: [&str; 5] = ["/tf_static", "/rosout", "/parameter_events", "/clock", "/robot_description"];

/// How the messages of a channel are read.
#[derive(Debug, Clone)]
pub enum Decoder {
    /// JSON tells itself what is in it.
    Json,
    /// ROS 2.
    Cdr(Rc<Definition>),
    /// protobuf.
    Protobuf(Rc<Descriptors>),
}

impl Decoder {
    /// The decoder of a channel.
    ///
    /// # Errors
    /// Why there is none, as the end of a sentence that begins with its messages.
    pub fn of(channel: &Channel) -> Result<Self, String> {
        let Schema { name, language, description } = &*channel.schema;
        match channel.encoding.as_str() {
            "json" => Ok(Self::Json),
            "cdr" => {
                let text =
                    std::str::from_utf8(description).map_err(|_| "have a definition that is no text".to_owned())?;
                Ok(Self::Cdr(Rc::new(ros::definition(name, language, text)?)))
            }
            "protobuf" if language == "protobuf" => Ok(Self::Protobuf(Rc::new(Descriptors::parse(name, description)?))),
            "protobuf" => Err(format!("are protobuf, but described in `{}`", crate::excerpt::shortened(language))),
            other => Err(format!("are encoded as `{}`; known: json, cdr, protobuf", crate::excerpt::shortened(other))),
        }
    }

    /// Reads a message.
    ///
    /// # Errors
    /// What is wrong with it, as the end of a sentence.
    pub fn read<'m>(&'m self, message: &'m [u8]) -> Result<Tree<'m>, String> {
        match self {
            Self::Json => tree::from_json(message),
            Self::Cdr(definition) => cdr::read(definition, message),
            Self::Protobuf(descriptors) => protobuf::read(descriptors, message),
        }
    }

    /// How its numbers are named.
    pub fn manner(&self, all: bool) -> Manner {
        let is_json = matches!(self, Self::Json);
        Manner { brackets: !is_json, truths: !is_json, all }
    }
}

/// Whether somebody who names no topic can mean this one.
pub fn is_movement(channel: &Channel) -> bool {
    let name = ros::definition::plain(&channel.schema.name);
    !NO_MOVEMENTS.contains(&name.as_str())
        && !NO_MOVEMENTS_IN.iter().any(|package| name.starts_with(package))
        && !NO_MOVEMENTS_ON.contains(&channel.topic.as_str())
}
