//! A file that is being written.

use crate::FileError;
use crate::inputs::refuse_input;
use crate::place::{Place, Stream, folder_of, place};
use std::ffi::OsString;
use std::fs::{self, File, Metadata, OpenOptions, Permissions};
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file that is being written. [`finish`](Output::finish) gives it its name; one that is dropped
/// before leaves nothing. Whoever is killed leaves `NAME.XXXXXX.partial` beside the place.
#[derive(Debug)]
pub struct Output {
    /// As it was named.
    path: PathBuf,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Written in place.
    InPlace(File),
    /// Written beside its place, which is the second.
    Whole(NamedTempFile, PathBuf),
}

impl Output {
    /// Begins a file.
    ///
    /// # Errors
    ///
    /// [`FileError`] when it is an input, or cannot be written.
    pub fn begin(path: &Path) -> Result<Self, FileError> {
        refuse_input(path)?;
        let kind = match place(path) {
            Place::Standard(stream) => standard(stream).map(Kind::InPlace),
            // appended: the file behind an open one may hold what others wrote
            Place::Device(at) => OpenOptions::new().append(true).open(at).map(Kind::InPlace),
            Place::Whole(at) => beside(&at).map(|file| Kind::Whole(file, at)),
        };
        let kind = kind.map_err(|error| FileError::Write { path: path.into(), error })?;
        Ok(Self { path: path.into(), kind })
    }

    /// Puts what was written on the disk, and gives it its name.
    ///
    /// # Errors
    ///
    /// [`FileError`] when that fails; a regular file is then as it was before.
    pub fn finish(self) -> Result<(), FileError> {
        let Self { path, kind } = self;
        let done = match kind {
            Kind::InPlace(mut file) => file.flush(),
            Kind::Whole(file, at) => {
                // an input that came there since, too
                refuse_input(&path)?;
                named(file, &at)
            }
        };
        done.map_err(|error| FileError::Write { path, error })
    }

    /// Leaves what was written beside its place, unfinished, for what cannot be written again; returns where it is.
    ///
    /// # Errors
    ///
    /// [`FileError`] when it cannot be kept.
    pub fn leave(self) -> Result<PathBuf, FileError> {
        let Self { path, kind } = self;
        match kind {
            Kind::InPlace(_) => Ok(path),
            Kind::Whole(file, _) => {
                let kept = file.keep();
                kept.map(|(_, at)| at)
                    .map_err(|error| FileError::Write { path, error: error.error })
            }
        }
    }

    /// The path, as it was named.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// An error of writing, with the name of the file.
    pub fn failed(&self, error: io::Error) -> FileError {
        FileError::Write { path: self.path.clone(), error }
    }

    fn file(&mut self) -> &mut File {
        match &mut self.kind {
            Kind::InPlace(file) => file,
            Kind::Whole(file, _) => file.as_file_mut(),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file().flush()
    }
}

/// Writes a file.
///
/// # Errors
///
/// [`FileError`] when it is an input, or cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<(), FileError> {
    let mut output = Output::begin(path)?;
    output.write_all(content).map_err(|error| output.failed(error))?;
    output.finish()
}

/// Makes a folder for outputs, where it is not there yet.
///
/// # Errors
///
/// [`FileError::Write`] when it cannot be made.
pub fn folder(path: &Path) -> Result<(), FileError> {
    fs::create_dir_all(path).map_err(|error| FileError::Write { path: path.into(), error })
}

/// Tries whether a file could be begun, and leaves nothing; a pipe is not opened, which would wait for
/// its reader.
///
/// # Errors
///
/// [`FileError`] as [`Output::begin`] would give it.
pub fn try_place(path: &Path) -> Result<(), FileError> {
    match place(path) {
        Place::Whole(_) => Output::begin(path).map(|_| ()),
        Place::Device(_) | Place::Standard(_) => refuse_input(path),
    }
}

/// Puts a file on the disk and gives it its name.
fn named(file: NamedTempFile, at: &Path) -> io::Result<()> {
    file.as_file().sync_all()?;
    file.persist(at).map_err(|error| error.error)?;
    // the new name, too; not every file system can
    let _ = File::open(folder_of(at)).and_then(|folder| folder.sync_all());
    Ok(())
}

fn standard(stream: Stream) -> io::Result<File> {
    let own = match stream {
        Stream::Output => io::stdout().as_fd().try_clone_to_owned(),
        Stream::Error => io::stderr().as_fd().try_clone_to_owned(),
    };
    own.map(File::from)
}

/// A file beside a place, with the permissions of the one that is there.
fn beside(at: &Path) -> io::Result<NamedTempFile> {
    let before = match fs::metadata(at) {
        Ok(found) if found.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(found) => {
            // renaming asks nothing of the file that is replaced: one that is write-protected stays
            OpenOptions::new().append(true).open(at)?;
            Some(found)
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    let Some(name) = at.file_name() else { return Err(io::ErrorKind::IsADirectory.into()) };
    let mut prefix = name.to_owned();
    prefix.push(".");
    // a long name leaves no room for more
    if prefix.len() > LONGEST_PREFIX {
        prefix = OsString::from("output.");
    }
    let folder = folder_of(at);
    if !folder.is_dir() {
        let said = format!("there is no folder {}", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, said));
    }
    let file = tempfile::Builder::new()
        .prefix(&prefix)
        .suffix(".partial")
        // less what the user's mask takes away
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder_of(at))?;
    if let Some(before) = before {
        keep(file.as_file(), &before)?;
    }
    Ok(file)
}

/// Names end at 255 bytes, of which six letters and `.partial` are ours.
const LONGEST_PREFIX: usize = 240;

/// Gives a file owner and permissions of the one that it replaces.
fn keep(file: &File, before: &Metadata) -> io::Result<()> {
    let now = file.metadata()?;
    if (now.uid(), now.gid()) != (before.uid(), before.gid()) {
        // only root may give a file away
        let _ = fchown(file, Some(before.uid()), Some(before.gid()));
    }
    file.set_permissions(before.permissions())
}
