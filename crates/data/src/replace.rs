//! Files are replaced as a whole or not at all.
//!
//! What is written stands first beside its place, in a file whose name has the writer's process id; then it is renamed. Links are
//! followed to the file that they mean, which keeps its mode and, where the system allows, its owner. What is no file (a device,
//! a FIFO) is written to as it is.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

use super::FileError;

/// How the names of half-written files begin. They remain when a process is killed at the wrong moment.
pub const HALF_WRITTEN: &str = ".half-written-";

/// As many links lead on at most, as the system's own bound.
const MOST_LINKS: usize = 40;

/// A half-written file that nobody holds and that did not change for so long has no writer, whatever its process id says:
/// numbers are given to new processes, and other machines have their own.
const ABANDONED: Duration = Duration::from_secs(60);

/// Writes a file so that at any moment, also after a crash, its path holds all the old bytes or all the new ones.
///
/// # Errors
/// [`FileError::Disk`].
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write(path, bytes).map_err(|source| FileError::disk("write", path, source))
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if is_special(path) {
        let mut file = File::options().write(true).open(path)?;
        return file.write_all(bytes);
    }
    let target = followed(path)?;
    let folder = folder_of(&target);
    sweep_once(folder);
    let mut builder = tempfile::Builder::new();
    let prefix = format!("{HALF_WRITTEN}{}-", std::process::id());
    builder.prefix(&prefix);
    // As for any new file, the umask takes away from this.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    // Held while the writer lives, however it ends. Where files cannot be locked, the process id has to do.
    #[cfg(unix)]
    let _ = file.as_file().try_lock();
    #[cfg(unix)]
    if let Ok(old) = fs::metadata(&target) {
        use std::os::unix::fs::MetadataExt;
        // Only the superuser may give files away: for others it is their own anyway.
        let _ = std::os::unix::fs::fchown(file.as_file(), Some(old.uid()), Some(old.gid()));
        file.as_file().set_permissions(old.permissions())?;
    }
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(&target).map_err(|error| error.error)?;
    // The new name must outlive a power cut as well.
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    Ok(())
}

/// Whether the path leads to something that is no file of its own: a device, a FIFO, an open stream.
fn is_special(path: &Path) -> bool {
    let streams = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"];
    cfg!(unix) && streams.iter().any(|stream| path.starts_with(stream))
        || fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// The place that the path means, links followed; the last of them may lead to a file that is not there yet.
fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut place = path.to_owned();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&place) {
            Ok(next) => place = folder_of(&place).join(next),
            Err(_) => return Ok(place),
        }
    }
    Err(io::Error::other("too many links lead on to each other"))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// Whether two paths mean one file, be it there or yet to be written. Devices may be named twice.
#[must_use]
pub fn is_one_file(a: &Path, b: &Path) -> bool {
    if is_special(a) || is_special(b) {
        return false;
    }
    #[cfg(unix)]
    if let (Ok(a), Ok(b)) = (fs::metadata(a), fs::metadata(b)) {
        use std::os::unix::fs::MetadataExt;
        return (a.dev(), a.ino()) == (b.dev(), b.ino());
    }
    let place = |path: &Path| -> Option<PathBuf> {
        let path = followed(path).ok()?;
        Some(folder_of(&path).canonicalize().ok()?.join(path.file_name()?))
    };
    place(a).is_some_and(|a| place(b) == Some(a))
}

/// Removes what writers that are gone left half-written in a folder; what a living one writes stays.
///
/// # Errors
/// Of the system: a folder that cannot be listed, a file that cannot be removed.
pub fn sweep(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)?.flatten() {
        let name = entry.file_name();
        let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(HALF_WRITTEN)) else { continue };
        if !entry.file_type()?.is_file() || !is_abandoned(&entry.path(), rest) {
            continue;
        }
        match fs::remove_file(entry.path()) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}

/// Whether nobody writes the file any more. `rest` of its name begins with the writer's process id, but for those that earlier
/// versions wrote.
fn is_abandoned(path: &Path, rest: &str) -> bool {
    let Ok(file) = File::open(path) else { return false };
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return false;
    }
    let writer = rest.split_once('-').and_then(|(id, _)| id.parse::<u32>().ok());
    let lives = match writer {
        None => false,
        Some(id) if id == std::process::id() => true,
        Some(id) => !Path::new("/proc/self").exists() || Path::new(&format!("/proc/{id}")).exists(),
    };
    let age = file.metadata().and_then(|found| found.modified()).ok().and_then(|changed| changed.elapsed().ok());
    !lives || age.is_some_and(|age| age > ABANDONED)
}

/// Sweeps a folder the first time that this process writes there. That it cannot is nothing that a write has to fail for.
fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let is_new = SWEPT.lock().is_ok_and(|mut swept| swept.insert(folder.to_owned()));
    if is_new {
        let _ = sweep(folder);
    }
}

#[cfg(test)]
#[path = "replace_tests.rs"]
mod tests;
