//! An output file that is written atomically.

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

/// An output file. [`finish`](Output::finish) gives it its final name; dropping it before deletes it. A killed process
/// leaves `NAME.XXXXXX.partial` in the same folder.
#[derive(Debug)]
pub struct Output {
    /// Path, as given by the user.
    path: PathBuf,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Device or pipe, written in place.
    InPlace(File),
    /// Regular file: the temporary file and its final path.
    Whole(NamedTempFile, PathBuf),
}

impl Output {
    /// Opens an output: a temporary file beside `path`, or `path` itself if it is a device or pipe.
    ///
    /// # Errors
    ///
    /// [`FileError`] if the file is an input or cannot be written.
    pub fn begin(path: &Path) -> Result<Self, FileError> {
        refuse_input(path)?;
        let kind = match place(path) {
            Place::Standard(stream) => standard(stream).map(Kind::InPlace),
            // append: the file behind an open descriptor may hold the output of other processes
            Place::Device(at) => OpenOptions::new().append(true).open(at).map(Kind::InPlace),
            Place::Whole(at) => beside(&at).map(|file| Kind::Whole(file, at)),
        };
        let kind = kind.map_err(|error| FileError::Write { path: path.into(), error })?;
        Ok(Self { path: path.into(), kind })
    }

    /// Syncs the file and gives it its final name.
    ///
    /// # Errors
    ///
    /// [`FileError`] if that fails; an existing regular file is then unchanged.
    pub fn finish(self) -> Result<(), FileError> {
        let Self { path, kind } = self;
        let done = match kind {
            Kind::InPlace(mut file) => file.flush(),
            Kind::Whole(file, at) => {
                // an input may have been registered since the file was opened
                refuse_input(&path)?;
                named(file, &at)
            }
        };
        done.map_err(|error| FileError::Write { path, error })
    }

    /// Keeps the unfinished file under its temporary name and returns that path, for data that cannot be produced
    /// again. The path of a device or pipe is the one that the user gave.
    ///
    /// # Errors
    ///
    /// [`FileError`] if the file cannot be kept.
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

    /// Path, as given by the user.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Wraps a write error with the file's name.
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

/// Writes `content` to a file atomically: the file has the old or the whole new content.
///
/// # Errors
///
/// [`FileError`] if the file is an input or cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<(), FileError> {
    let mut output = Output::begin(path)?;
    output.write_all(content).map_err(|error| output.failed(error))?;
    output.finish()
}

/// Creates a folder for outputs if it does not exist.
///
/// # Errors
///
/// [`FileError::Write`] if it cannot be created.
pub fn folder(path: &Path) -> Result<(), FileError> {
    fs::create_dir_all(path).map_err(|error| FileError::Write { path: path.into(), error })
}

/// Checks whether an output could be opened, without creating it. A pipe is not opened: that would block until a reader
/// comes.
///
/// # Errors
///
/// The error that [`Output::begin`] would return.
pub fn try_place(path: &Path) -> Result<(), FileError> {
    match place(path) {
        Place::Whole(_) => Output::begin(path).map(|_| ()),
        Place::Device(_) | Place::Standard(_) => refuse_input(path),
    }
}

/// Syncs a temporary file and renames it.
fn named(file: NamedTempFile, at: &Path) -> io::Result<()> {
    file.as_file().sync_all()?;
    file.persist(at).map_err(|error| error.error)?;
    // syncs the folder's new entry as well; some file systems do not support that
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

/// A temporary file in the folder of `at`, with the permissions of an existing file there.
fn beside(at: &Path) -> io::Result<NamedTempFile> {
    let before = match fs::metadata(at) {
        Ok(found) if found.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(found) => {
            // a rename ignores the permissions of the replaced file: this refuses a write-protected one
            OpenOptions::new().append(true).open(at)?;
            Some(found)
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    let Some(name) = at.file_name() else { return Err(io::ErrorKind::IsADirectory.into()) };
    let mut prefix = name.to_owned();
    prefix.push(".");
    // keeps the temporary name within the file system's limit
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
        // the process's umask reduces these permissions
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder_of(at))?;
    if let Some(before) = before {
        keep(file.as_file(), &before)?;
    }
    Ok(file)
}

/// File names have at most 255 bytes, of which six random letters and `.partial` are appended.
const LONGEST_PREFIX: usize = 240;

/// Copies owner and permissions of the file that is replaced.
fn keep(file: &File, before: &Metadata) -> io::Result<()> {
    let now = file.metadata()?;
    if (now.uid(), now.gid()) != (before.uid(), before.gid()) {
        // only root may change the owner
        let _ = fchown(file, Some(before.uid()), Some(before.gid()));
    }
    file.set_permissions(before.permissions())
}
