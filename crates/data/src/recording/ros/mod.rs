//! ROS 2 messages without ROS: definitions as recordings hold them, and what they say of the bytes of a message.

pub mod cdr;
pub mod definition;
mod idl;
mod known;
mod msg;

use definition::Definition;

/// The definition of messages of type `name`: the text in the recording, else what is known of common types.
///
/// # Errors
/// Why there is none, as the end of a sentence.
pub fn definition(name: &str, language: &str, text: &str) -> Result<Definition, String> {
    let name = definition::plain(name);
    let types = match language {
        _ if text.trim().is_empty() => known::types(&name)
            .ok_or_else(|| format!("are of type `{name}`, whose definition is neither in the recording nor known"))?,
        "ros2msg" => msg::parse(&name, text)?,
        "ros2idl" => idl::parse(text)?,
        other => return Err(format!("are described in `{other}`; known: ros2msg, ros2idl")),
    };
    Definition::of(&name, types)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub use tests::Dice;
