//! The folder of one training run. Files in it are replaced as a whole or not at all, and one process at a time writes.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use crate::failure::{Failure, Result};
use scrnn_data as files;

/// The experiment with every value explicit.
pub const EXPERIMENT: &str = "experiment.toml";
/// The newest state, from which training goes on.
pub const CHECKPOINT: &str = "checkpoint.safetensors";
/// The network with the lowest nll so far.
pub const BEST: &str = "best.safetensors";
/// One row every so many epochs.
pub const HISTORY: &str = "history.csv";
/// Held while a process trains here.
const LOCK: &str = "lock";
/// How the names of claims begin: whoever works on one of many networks holds the folder by such a file, see the crate `scrnn-sweep`.
pub const CLAIM: &str = "claim-";

/// All that a training keeps there.
pub const FILES: [&str; 5] = [EXPERIMENT, CHECKPOINT, BEST, HISTORY, LOCK];

/// The folder of member `k`, from 1, in the run at `path`.
pub fn member(path: &Path, k: usize) -> PathBuf {
    path.join(format!("member-{k}"))
}

/// The folders of all members of the run at `path`; none if it is the run of a single network.
pub fn members(path: &Path) -> Vec<PathBuf> {
    if path.join(CHECKPOINT).exists() {
        return Vec::new();
    }
    (1..).map(|k| member(path, k)).take_while(|folder| folder.join(CHECKPOINT).exists()).collect()
}

/// A run folder that this process owns.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// The system frees the lock when the process ends, however it ends.
    _lock: File,
}

impl RunFolder {
    /// Makes the folder if need be, takes its lock, and sweeps away what a killed process left half-written.
    ///
    /// # Errors
    /// [`Failure::Refused`] while another process trains there, [`Failure::Disk`].
    pub fn open(path: &Path) -> Result<Self> {
        fs::create_dir_all(path).map_err(|error| Failure::disk("make the folder", path, error))?;
        for file in FILES.map(|name| path.join(name)) {
            // Opening a pipe would wait for somebody at its other end.
            if fs::metadata(&file).is_ok_and(|found| !found.is_file()) {
                let message = format!("{} is no file, and a training would write there", file.display());
                return Err(Failure::refused(message, "move it away, or choose another folder with --out"));
            }
        }
        let lock_path = path.join(LOCK);
        let lock = File::options().create(true).truncate(false).write(true).open(&lock_path);
        let lock = lock.map_err(|error| Failure::disk("open", &lock_path, error))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Failure::refused(
                    format!("another process is training in {}", path.display()),
                    "wait for it or stop it, or choose another folder with --out",
                ));
            }
            // Some file systems have no locks. Then a claim keeps others out.
            Err(TryLockError::Error(_)) if is_claimed(path) => {}
            Err(TryLockError::Error(error)) => return Err(Failure::disk("lock", &lock_path, error)),
        }
        files::sweep(path).map_err(|error| Failure::disk("remove half-written files in", path, error))?;
        Ok(Self { path: path.to_owned(), _lock: lock })
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the file `name` is.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Replaces the file `name` as a whole.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        Ok(files::replace(&self.file(name), bytes)?)
    }

    /// Removes the file `name` if it is there.
    pub fn remove(&self, name: &str) -> Result<()> {
        match fs::remove_file(self.file(name)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(Failure::disk("remove", &self.file(name), error))
            }
            _ => Ok(()),
        }
    }
}

/// Whether somebody claims the folder, be it this process or another.
fn is_claimed(path: &Path) -> bool {
    let names = fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.file_name());
    names.into_iter().any(|name| name.to_string_lossy().starts_with(CLAIM))
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn_data::HALF_WRITTEN;

    #[test]
    fn a_second_owner_is_refused_until_the_first_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let first = RunFolder::open(folder.path()).unwrap();
        let failure = RunFolder::open(folder.path()).unwrap_err();
        assert_eq!(failure.code(), 5);
        drop(first);
        RunFolder::open(folder.path()).unwrap();
    }

    #[test]
    fn what_is_no_file_in_a_place_of_one_is_refused() {
        for name in FILES {
            let folder = tempfile::tempdir().unwrap();
            fs::create_dir(folder.path().join(name)).unwrap();
            let failure = RunFolder::open(folder.path()).unwrap_err();
            assert!(failure.code() == 5 && failure.to_string().contains(name), "{failure}");
        }
    }

    #[test]
    fn half_written_files_are_swept_away_and_others_kept() {
        let folder = tempfile::tempdir().unwrap();
        let half = folder.path().join(format!("{HALF_WRITTEN}x"));
        fs::write(&half, "x").unwrap();
        fs::write(folder.path().join("notes.txt"), "x").unwrap();
        let run = RunFolder::open(folder.path()).unwrap();
        run.write(CHECKPOINT, b"new").unwrap();
        assert!(!half.exists() && folder.path().join("notes.txt").exists());
        assert_eq!(fs::read(run.file(CHECKPOINT)).unwrap(), b"new");
        run.remove(CHECKPOINT).unwrap();
        run.remove(CHECKPOINT).unwrap();
        assert!(!run.file(CHECKPOINT).exists());
    }
}
