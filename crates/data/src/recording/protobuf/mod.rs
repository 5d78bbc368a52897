//! protobuf messages, read by the descriptors that stand in the recording (a `FileDescriptorSet`).

mod descriptor;
mod message;
mod wire;

pub use descriptor::Descriptors;
pub use message::read;

#[cfg(test)]
mod tests;
