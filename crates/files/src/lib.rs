//! Files: inputs are read within bounds, outputs written whole and never over an input.
//!
//! Everything that a command writes goes through [`Output`]:
//!
//! - A regular file is written beside its place, put on the disk, and then renamed: whoever looks
//!   finds what was there before, or all of the new. Its permissions stay, and its owner where the
//!   process may set it.
//! - A symbolic link stays; what it points to is written whole.
//! - A device, a pipe, `/dev/stdout` or `/dev/fd/3` is written in place, and never replaced.
//! - A file that was read, or named as an input, is refused, by whatever path or link it is named.

mod error;
mod folder;
mod identity;
mod inputs;
mod output;
mod place;

pub use error::FileError;
pub use folder::Folder;
pub use identity::Identity;
pub use inputs::{bytes, own_text, protect, text};
pub use output::{Output, folder, try_place, write};
