//! Outputs over existing files, links, pipes and devices.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_files::{FileError, Folder, Output, bytes, folder, protect, text, try_place, write};
use std::fs;
use std::io::Write;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_file_is_replaced_whole_or_left_unchanged() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("log.csv");
    write(&path, b"old").unwrap();
    let mut output = Output::begin(&path).unwrap();
    output.write_all(b"half of the ne").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"old");
    drop(output);
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(dir.path()), ["log.csv"]);
    write(&path, b"new").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(names(dir.path()), ["log.csv"]);
}

#[test]
fn permissions_are_kept_and_new_files_follow_the_umask() {
    let dir = TempDir::new().unwrap();
    let (path, plain, other) =
        (dir.path().join("a.csv"), dir.path().join("plain"), dir.path().join("b.csv"));
    fs::write(&path, "old").unwrap();
    fs::write(&plain, "").unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
    write(&path, b"new").unwrap();
    assert_eq!(fs::metadata(&path).unwrap().mode() & 0o7777, 0o640);
    write(&other, b"new").unwrap();
    let usual = fs::metadata(&plain).unwrap().mode();
    assert_eq!(fs::metadata(&other).unwrap().mode(), usual);
}

#[test]
fn a_link_stays_and_its_target_is_written() {
    let dir = TempDir::new().unwrap();
    fs::create_dir(dir.path().join("kept")).unwrap();
    let (first, second) = (dir.path().join("latest"), dir.path().join("link"));
    symlink("kept/run.csv", &second).unwrap();
    symlink("link", &first).unwrap();
    // first without, then with an existing target
    for content in ["one", "two"] {
        write(&first, content.as_bytes()).unwrap();
        assert!(fs::symlink_metadata(&first).unwrap().is_symlink());
        assert!(fs::symlink_metadata(&second).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(dir.path().join("kept/run.csv")).unwrap(), content);
    }
    assert_eq!(names(&dir.path().join("kept")), ["run.csv"]);
}

#[test]
fn an_input_is_not_overwritten_by_any_path() {
    let dir = TempDir::new().unwrap();
    let input = dir.path().join("v.csv");
    fs::write(&input, "mine").unwrap();
    fs::create_dir(dir.path().join("sub")).unwrap();
    let (hard, soft) = (dir.path().join("hard.csv"), dir.path().join("soft.csv"));
    fs::hard_link(&input, &hard).unwrap();
    symlink("v.csv", &soft).unwrap();
    symlink(dir.path(), dir.path().join("sub/up")).unwrap();
    assert_eq!(text(&input, "log", 100).unwrap(), "mine");
    let ways: [PathBuf; 5] = [
        input.clone(),
        hard,
        soft,
        dir.path().join("sub/../v.csv"),
        dir.path().join("sub/up/v.csv"),
    ];
    for way in ways {
        for error in [write(&way, b"over").unwrap_err(), try_place(&way).unwrap_err()] {
            assert!(matches!(error, FileError::IsInput { .. }), "{}: {error}", way.display());
            assert!(error.to_string().contains("v.csv"), "{error}");
        }
        assert_eq!(fs::read_to_string(&input).unwrap(), "mine", "{}", way.display());
    }
    write(&dir.path().join("w.csv"), b"another").unwrap();
    // an editor replaced the input since it was read: the same path, another inode
    fs::write(dir.path().join("new"), "mine, edited").unwrap();
    fs::rename(dir.path().join("new"), &input).unwrap();
    assert!(write(&input, b"over").is_err());
}

#[test]
fn an_input_that_appears_while_a_file_is_written_is_kept() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("later.toml");
    let output = Output::begin(&path).unwrap();
    fs::write(&path, "mine").unwrap();
    protect(&path);
    assert!(matches!(output.finish(), Err(FileError::IsInput { .. })));
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    assert_eq!(names(dir.path()), ["later.toml"]);
}

#[test]
fn a_pipe_is_written_in_place() {
    let dir = TempDir::new().unwrap();
    let pipe = dir.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = Command::new("cat").arg(&pipe).stdout(Stdio::piped()).spawn().unwrap();
    // a pipe that was read has no content to be protected
    protect(&pipe);
    write(&pipe, b"through").unwrap();
    assert_eq!(reader.wait_with_output().unwrap().stdout, b"through");
    assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
    assert_eq!(names(dir.path()), ["pipe"]);
}

#[test]
fn devices_are_written_in_place_and_a_full_one_is_an_error() {
    let dir = TempDir::new().unwrap();
    let link = dir.path().join("null");
    symlink("/dev/null", &link).unwrap();
    write(Path::new("/dev/null"), b"away").unwrap();
    write(&link, b"away").unwrap();
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    let message = write(Path::new("/dev/full"), b"too much").unwrap_err().to_string();
    assert!(message.contains("/dev/full") && message.contains("space"), "{message}");
    assert!(fs::metadata("/dev/full").unwrap().file_type().is_char_device());
}

#[test]
fn an_invalid_output_path_is_an_error() {
    let dir = TempDir::new().unwrap();
    for path in [dir.path().join("none/x.csv"), dir.path().to_path_buf(), dir.path().join("..")] {
        assert!(matches!(write(&path, b""), Err(FileError::Write { .. })), "{}", path.display());
        assert!(try_place(&path).is_err());
    }
    fs::write(dir.path().join("file"), "").unwrap();
    assert!(folder(&dir.path().join("file/sub")).is_err());
    let (a, b) = (dir.path().join("a"), dir.path().join("b"));
    symlink("b", &a).unwrap();
    symlink("a", &b).unwrap();
    assert!(write(&a, b"").is_err());
    assert_eq!(names(dir.path()), ["a", "b", "file"]);
}

/// If the temporary file has been removed, finishing reports an error.
#[test]
fn a_temporary_file_removed_while_written_is_an_error() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("run.mcap");
    let mut output = Output::begin(&path).unwrap();
    output.write_all(b"rows").unwrap();
    let partial = names(dir.path()).pop().unwrap();
    assert!(partial.starts_with("run.mcap.") && partial.ends_with(".partial"), "{partial}");
    fs::remove_file(dir.path().join(partial)).unwrap();
    assert!(matches!(output.finish(), Err(FileError::Write { .. })));
    assert!(!path.exists());
}

#[test]
fn a_folder_is_written_whole_or_not_at_all() {
    let dir = TempDir::new().unwrap();
    let at = dir.path().join("logs");
    let begun = Folder::begin(&at).unwrap();
    write(&begun.path().join("a.csv"), b"1").unwrap();
    assert!(!at.exists());
    drop(begun);
    assert!(names(dir.path()).is_empty());
    let begun = Folder::begin(&at).unwrap();
    write(&begun.path().join("a.csv"), b"1").unwrap();
    begun.finish().unwrap();
    assert_eq!(names(dir.path()), ["logs"]);
    assert_eq!(names(&at), ["a.csv"]);
    assert!(Folder::begin(&at).is_err());
}

#[test]
fn reading_stops_at_the_size_limit() {
    let message = bytes(Path::new("/dev/zero"), "crane file", 1_000_000).unwrap_err().to_string();
    assert!(message.contains("1000 kB") && message.contains("crane file"), "{message}");
    assert!(message.contains("device"), "{message}");
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("long.toml");
    fs::write(&path, vec![b'['; 1001]).unwrap();
    assert!(matches!(text(&path, "mapping", 1000), Err(FileError::TooLong { .. })));
    assert_eq!(text(&path, "mapping", 1001).unwrap().len(), 1001);
    fs::write(&path, b"ab\xff").unwrap();
    assert!(matches!(text(&path, "mapping", 1000), Err(FileError::NotText { at: 2, .. })));
    assert!(matches!(text(&dir.path().join("no"), "mapping", 9), Err(FileError::Read { .. })));
}
