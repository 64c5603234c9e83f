//! File access: inputs are read up to a size limit, outputs are written atomically and never over an input.
//!
//! Every file that a command writes goes through [`Output`]:
//!
//! - A regular file is written under a temporary name, synced, and renamed. A reader sees the old file or the complete
//!   new one. The permissions are kept, and the owner where the process may set it.
//! - A symbolic link is kept; its target is replaced in the same way.
//! - A device, a pipe, `/dev/stdout` or `/dev/fd/3` is written in place.
//! - A file that was read, or named as an input, is refused, whatever path or link leads to it.

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
