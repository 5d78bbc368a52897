//! The crate `paste` is no longer maintained (RUSTSEC-2024-0436); `pastey` carries its macro on. pulp and mcap ask for the old
//! name, and `[patch.crates-io]` in the workspace's manifest gives them this crate instead. When neither asks for it any more,
//! this crate goes.

#![no_std]

pub use pastey::paste;
