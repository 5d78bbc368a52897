//! One worker at a time for each run, on any number of machines with one file system, without a server and without file locks.
//!
//! Whoever works on a run holds a file in its folder: `claim-1`, or the next number if somebody held it before and is gone. A claim says who
//! holds it, and is renewed while the holder lives. What makes this safe is that a name can be made by one process only:
//!
//! ```text
//! take      no claim: make claim-1.  claim-N whose holder is gone: make claim-(N+1), and leave claim-N where it is
//!           then look again: hold it only if no higher one is there and claim-N is still the one that was looked at
//! renew     write a beat into it every few seconds; a claim with a higher number ends the work
//! release   remove the lower ones, then the own
//! ```
//!
//! Of two that take over one claim at the same time, one cannot make the file; of two where one looked earlier, one sees a higher number or
//! another claim-N, and steps back. Numbers count how often a holder was lost.
//!
//! A holder is gone if it is a process of this machine that no longer runs, or if its claim was not renewed for a stated time. That time
//! is told by the file system's own clock, so machines need not agree about the time.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime};

use scrnn_run::failure::{Failure, Result};
use scrnn_run::interrupt::Interrupt;
use scrnn_run::run_folder::CLAIM;
use serde::{Deserialize, Serialize};

/// How long a claim of another machine may go without being renewed.
pub const PATIENCE: Duration = Duration::from_secs(120);
/// Between two renewals, as a part of that.
const RENEWALS: u32 = 8;
/// Between two looks at whether somebody asked to stop.
const LOOK: Duration = Duration::from_millis(50);
/// How the names begin of claims that are being written.
const WRITTEN: &str = ".half-written-";

/// Who holds a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// The machine's name.
    pub host: String,
    /// The process.
    pub process: u32,
    /// Which processes it can be told from: those of one start of one machine, and of one container.
    pub place: String,
    /// When that process began, in the system's own count; tells it from a later one with its number.
    pub began: u64,
    /// Seconds of 1970, for people.
    pub since: u64,
    /// Tells this claim from all others.
    pub token: String,
    /// The checkpoint that was there when the run was taken, by its length and time: whether a lost holder got any further.
    pub found: String,
}

/// A run that this process holds.
#[derive(Debug)]
pub struct Claim {
    folder: PathBuf,
    number: u64,
    token: String,
}

/// What came of trying to take a run.
#[derive(Debug)]
pub enum Taken {
    /// It is held now.
    Held(Claim),
    /// Somebody else works on it.
    Busy,
    /// So many holders were lost one after the other, and none of them got further.
    Deadly(u64),
}

/// So many holders may be lost without getting any further, before a run is left alone.
pub const MOST_LOST: u64 = 10;

/// The newest claim on a run.
#[derive(Debug, Clone)]
pub struct Newest {
    /// Its number: one more than holders were lost before.
    pub number: u64,
    /// Who holds it; none where the file cannot be read.
    pub holder: Option<Holder>,
    /// How long ago it was renewed, by this machine's clock.
    pub age: Duration,
}

impl Newest {
    /// Whether its holder is a process of this machine that runs no more.
    #[must_use]
    pub fn is_dead(&self) -> bool {
        self.holder.as_ref().is_some_and(|holder| holder.place == me().place && !me().place.is_empty() && !runs(holder))
    }
}

/// What is the same for all claims of this process.
struct Me {
    host: String,
    place: String,
    began: u64,
}

fn me() -> &'static Me {
    static ME: LazyLock<Me> = LazyLock::new(|| {
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default().trim().to_owned();
        let host = match read("/proc/sys/kernel/hostname") {
            none if none.is_empty() => {
                std::env::var("HOSTNAME").or_else(|_| std::env::var("COMPUTERNAME")).unwrap_or_default()
            }
            host => host,
        };
        let boot = read("/proc/sys/kernel/random/boot_id");
        let container = fs::read_link("/proc/self/ns/pid").map(|link| link.display().to_string()).unwrap_or_default();
        // Where the system does not tell, nobody is known to be dead, and time has to tell.
        let known = !boot.is_empty() && !container.is_empty();
        let place = if known { format!("{boot} {container}") } else { String::new() };
        Me { host, place, began: began("self").unwrap_or(0) }
    });
    &ME
}

/// When a process began, in ticks since the machine did.
fn began(process: &str) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name, which may hold anything, ends with the last bracket.
    let (_, rest) = text.rsplit_once(')')?;
    let mut fields = rest.split_whitespace();
    let state = fields.next()?;
    // What is killed and not yet waited for does nothing more.
    (!matches!(state, "Z" | "X")).then(|| fields.nth(18)?.parse().ok()).flatten()
}

fn runs(holder: &Holder) -> bool {
    began(&holder.process.to_string()) == Some(holder.began)
}

/// A name that no other claim has.
fn token() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let me = me();
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos();
    format!("{}-{}-{}-{now:x}-{}", me.host, std::process::id(), me.began, COUNT.fetch_add(1, Ordering::Relaxed))
}

fn path_of(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("{CLAIM}{number}"))
}

/// The numbers of all claims in a folder.
fn numbers(folder: &Path) -> io::Result<Vec<u64>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut found = Vec::new();
    for entry in entries {
        if let Some(number) = entry?.file_name().to_str().and_then(|name| name.strip_prefix(CLAIM)?.parse().ok()) {
            found.push(number);
        }
    }
    found.sort_unstable();
    Ok(found)
}

fn read(folder: &Path, number: u64) -> Option<Holder> {
    let text = fs::read_to_string(path_of(folder, number)).ok()?;
    serde_json::from_str(text.lines().next()?).ok()
}

/// The newest claim on the run in `folder`, if there is one.
#[must_use]
pub fn newest(folder: &Path) -> Option<Newest> {
    let number = *numbers(folder).ok()?.last()?;
    let changed = fs::metadata(path_of(folder, number)).and_then(|found| found.modified()).ok()?;
    let age = SystemTime::now().duration_since(changed).unwrap_or_default();
    Some(Newest { number, holder: read(folder, number), age })
}

/// Removes every claim on the run in `folder`: for one whose holders were all lost, and that is to be tried once more.
pub fn forget(folder: &Path) {
    for number in numbers(folder).unwrap_or_default() {
        let _ = fs::remove_file(path_of(folder, number));
    }
}

/// Whether a claim was not renewed for so long, by the file system's clock, which `now` was just written by. One that has just vanished is
/// looked at again later.
fn is_old(claim: &Path, (now, patience): (&Path, Duration)) -> bool {
    let changed = |path: &Path| fs::metadata(path).and_then(|found| found.modified()).ok();
    let (Some(then), Some(now)) = (changed(claim), changed(now)) else { return false };
    now.duration_since(then).is_ok_and(|age| age > patience)
}

/// What tells whether a training got further.
fn mark(checkpoint: &Path) -> String {
    let Ok(found) = fs::metadata(checkpoint) else { return String::new() };
    let changed = found.modified().ok().and_then(|changed| changed.duration_since(SystemTime::UNIX_EPOCH).ok());
    format!("{} {}", found.len(), changed.unwrap_or_default().as_nanos())
}

impl Claim {
    /// Tries to take the run in `folder`, which is made if need be. `checkpoint` is what a holder that gets anywhere replaces.
    ///
    /// # Errors
    /// [`Failure::Disk`].
    pub fn take(folder: &Path, checkpoint: &Path, patience: Duration) -> Result<Taken> {
        fs::create_dir_all(folder).map_err(|error| Failure::disk("make the folder", folder, error))?;
        let disk = |error| Failure::disk("claim the run in", folder, error);
        let there = numbers(folder).map_err(disk)?;
        let before = there.last().copied();
        let holder = before.and_then(|number| read(folder, number));
        let is_near = holder.as_ref().is_some_and(|holder| !me().place.is_empty() && holder.place == me().place);
        if is_near && holder.as_ref().is_some_and(runs) {
            return Ok(Taken::Busy);
        }
        // The claim that is written stands beside its place first, and tells the file system's time.
        let mine = Written::new(folder, mark(checkpoint)).map_err(disk)?;
        if let Some(number) = before.filter(|_| !is_near)
            && !is_old(&path_of(folder, number), (&mine.path, patience))
        {
            return Ok(Taken::Busy);
        }
        let lost = before.map(|_| holder.map(|holder| holder.token));
        if let Some(number) = before.filter(|&number| number >= MOST_LOST) {
            let found = |number| read(folder, number).map(|holder| holder.found);
            if found(number + 1 - MOST_LOST) == Some(mark(checkpoint)) {
                return Ok(Taken::Deadly(MOST_LOST));
            }
        }
        let number = before.unwrap_or(0) + 1;
        if !mine.becomes(&path_of(folder, number)).map_err(disk)? {
            return Ok(Taken::Busy);
        }
        let claim = Self { folder: folder.to_owned(), number, token: mine.token.clone() };
        let now = numbers(folder).map_err(disk)?;
        let highest = now.last() == Some(&number);
        let unchanged = lost
            .is_none_or(|token| now.contains(&(number - 1)) && read(folder, number - 1).map(|one| one.token) == token);
        if highest && unchanged {
            return Ok(Taken::Held(claim));
        }
        claim.remove_own();
        Ok(Taken::Busy)
    }

    /// Whether nobody took the run over.
    #[must_use]
    pub fn still_holds(&self) -> bool {
        let Ok(there) = numbers(&self.folder) else { return true };
        there.last() == Some(&self.number) && read(&self.folder, self.number).is_none_or(|one| one.token == self.token)
    }

    /// A beat: the file system notes its own time. That it cannot be written is seen when it is too old.
    fn renew(&self) {
        if let Ok(mut file) = File::options().append(true).open(path_of(&self.folder, self.number)) {
            let _ = file.write_all(b".");
        }
    }

    /// Gives the run back. What was lost before is forgotten.
    pub fn release(self) {
        for number in numbers(&self.folder).unwrap_or_default().into_iter().filter(|&number| number < self.number) {
            let _ = fs::remove_file(path_of(&self.folder, number));
        }
        self.remove_own();
    }

    fn remove_own(&self) {
        if read(&self.folder, self.number).is_none_or(|one| one.token == self.token) {
            let _ = fs::remove_file(path_of(&self.folder, self.number));
        }
    }
}

/// A claim that is written, and not yet in its place.
struct Written {
    path: PathBuf,
    token: String,
    text: String,
}

impl Written {
    fn new(folder: &Path, found: String) -> io::Result<Self> {
        let (me, token) = (me(), token());
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
        let holder = Holder {
            host: me.host.clone(),
            process: std::process::id(),
            place: me.place.clone(),
            began: me.began,
            since,
            token: token.clone(),
            found,
        };
        let text = serde_json::to_string(&holder).map_err(io::Error::other)? + "\n";
        // By this name it is swept away if its writer is killed.
        let path = folder.join(format!("{WRITTEN}{}-claim-{token}", std::process::id()));
        let mut file = File::create_new(&path)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        Ok(Self { path, token, text })
    }

    /// Puts it in its place, whole; false if something is there.
    fn becomes(&self, place: &Path) -> io::Result<bool> {
        match fs::hard_link(&self.path, place) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            // Some file systems have no second names. For a moment others then see a claim without a holder.
            Err(_) => match File::create_new(place) {
                Ok(mut file) => file.write_all(self.text.as_bytes()).map(|()| true),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
                Err(error) => Err(error),
            },
        }
    }
}

impl Drop for Written {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// Claims, each with what ends its work.
type Held = Arc<Mutex<Vec<(Arc<Claim>, Interrupt)>>>;

/// Keeps the claims of a process alive, and passes on to each run that somebody wants to stop, or has taken it over.
#[derive(Debug)]
pub struct Keeper {
    held: Held,
    end: Interrupt,
    thread: Option<thread::JoinHandle<()>>,
}

impl Keeper {
    /// For claims that others take over after `patience`.
    #[must_use]
    pub fn new(interrupt: &Interrupt, patience: Duration) -> Self {
        let held: Held = Arc::default();
        let end = Interrupt::new();
        let (seen, over, asked) = (Arc::clone(&held), end.clone(), interrupt.clone());
        let looks = ((patience / RENEWALS).as_millis() / LOOK.as_millis()).max(1);
        let keep = move || {
            for look in 1.. {
                thread::sleep(LOOK);
                if over.asked() {
                    return;
                }
                let all: Vec<(Arc<Claim>, Interrupt)> = lock(&seen).clone();
                for (claim, own) in &all {
                    if asked.asked() {
                        own.ask();
                    }
                    if look % looks == 0 {
                        if !claim.still_holds() {
                            own.ask();
                        }
                        claim.renew();
                    }
                }
            }
        };
        // Without the thread nothing is renewed: then others take over after a while, and all come to the same bits.
        let thread = thread::Builder::new().name("claims".to_owned()).spawn(keep).ok();
        Self { held, end, thread }
    }

    /// Keeps a claim, until [`Keeper::give_back`]. The interrupt is asked when its work is to end.
    #[must_use]
    pub fn keep(&self, claim: Claim) -> (Arc<Claim>, Interrupt) {
        let (claim, interrupt) = (Arc::new(claim), Interrupt::new());
        lock(&self.held).push((Arc::clone(&claim), interrupt.clone()));
        (claim, interrupt)
    }

    /// Gives a run back.
    pub fn give_back(&self, claim: Arc<Claim>) {
        lock(&self.held).retain(|(other, _)| !Arc::ptr_eq(other, &claim));
        let Claim { folder, number, token } = &*claim;
        Claim { folder: folder.clone(), number: *number, token: token.clone() }.release();
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.end.ask();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Nothing panics while it holds the lock.
fn lock<T>(held: &Mutex<T>) -> MutexGuard<'_, T> {
    held.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Place(tempfile::TempDir);

    impl Place {
        fn new() -> Self {
            Self(tempfile::tempdir().unwrap())
        }

        fn take(&self, patience: Duration) -> Taken {
            Claim::take(self.0.path(), &self.0.path().join("checkpoint"), patience).unwrap()
        }

        fn held(&self) -> Claim {
            match self.take(PATIENCE) {
                Taken::Held(claim) => claim,
                other => panic!("{other:?}"),
            }
        }

        /// A claim of somebody whose process is not of this machine, or runs no more.
        fn strange(&self, number: u64, change: impl FnOnce(&mut Holder)) {
            let me = me();
            let mut holder = Holder {
                host: "elsewhere".into(),
                process: u32::MAX - 1,
                place: me.place.clone(),
                began: 1,
                since: 0,
                token: format!("token {number}"),
                found: String::new(),
            };
            change(&mut holder);
            fs::write(path_of(self.0.path(), number), serde_json::to_string(&holder).unwrap() + "\n").unwrap();
        }

        fn files(&self) -> Vec<String> {
            let names =
                fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
            let mut names: Vec<String> = names.collect();
            names.sort();
            names
        }
    }

    #[test]
    fn a_run_has_one_holder_until_it_is_given_back() {
        let place = Place::new();
        let claim = place.held();
        assert!(
            matches!(place.take(Duration::ZERO), Taken::Busy),
            "a living process of this machine is never passed over"
        );
        assert_eq!(place.files(), ["claim-1"]);
        claim.release();
        assert!(place.files().is_empty());
        place.held();
    }

    #[test]
    fn of_many_that_try_at_once_one_holds_it() {
        for _ in 0..20 {
            let place = Place::new();
            place.strange(1, |_| {});
            let held = Mutex::new(0);
            thread::scope(|scope| {
                for _ in 0..8 {
                    scope.spawn(|| {
                        if let Taken::Held(_) = place.take(PATIENCE) {
                            *lock(&held) += 1;
                        }
                    });
                }
            });
            assert_eq!((held.into_inner().unwrap(), place.files()), (1, vec!["claim-1".into(), "claim-2".into()]));
        }
    }

    #[test]
    fn a_dead_holder_is_passed_over_at_once_and_a_distant_one_after_a_while() {
        let place = Place::new();
        place.strange(1, |_| {});
        assert_eq!(place.held().number, 2);
        let place = Place::new();
        place.strange(1, |holder| holder.place = "another machine".into());
        assert!(matches!(place.take(PATIENCE), Taken::Busy));
        thread::sleep(Duration::from_millis(30));
        assert!(matches!(place.take(Duration::from_millis(10)), Taken::Held(claim) if claim.number == 2));
        // What cannot be read may be half written.
        let place = Place::new();
        fs::write(path_of(place.0.path(), 1), "").unwrap();
        assert!(matches!(place.take(PATIENCE), Taken::Busy));
    }

    #[test]
    fn who_was_passed_over_notices_and_stops() {
        let place = Place::new();
        let keeper = Keeper::new(&Interrupt::new(), Duration::from_millis(400));
        let (claim, interrupt) = keeper.keep(place.held());
        thread::sleep(Duration::from_millis(200));
        assert!(claim.still_holds() && !interrupt.asked());
        let beats = fs::read_to_string(path_of(place.0.path(), 1)).unwrap();
        assert!(beats.lines().nth(1).is_some_and(|beats| beats.starts_with('.')), "{beats}");
        place.strange(2, |holder| holder.place = "another machine".into());
        thread::sleep(Duration::from_millis(300));
        assert!(interrupt.asked() && !claim.still_holds());
        keeper.give_back(claim);
        assert_eq!(place.files(), ["claim-2"], "the other's claim stays");
    }

    #[test]
    fn a_wish_to_stop_reaches_every_run() {
        let (place, asked) = (Place::new(), Interrupt::new());
        let keeper = Keeper::new(&asked, PATIENCE);
        let (claim, own) = keeper.keep(place.held());
        asked.ask();
        thread::sleep(Duration::from_millis(300));
        assert!(own.asked());
        keeper.give_back(claim);
    }

    #[test]
    fn a_run_that_kills_whoever_takes_it_is_left_alone() {
        let place = Place::new();
        for number in 1..=MOST_LOST {
            place.strange(number, |_| {});
        }
        assert!(matches!(place.take(PATIENCE), Taken::Deadly(MOST_LOST)));
        // One of them got further.
        fs::write(place.0.path().join("checkpoint"), "x").unwrap();
        assert!(matches!(place.take(PATIENCE), Taken::Held(claim) if claim.number == MOST_LOST + 1));
    }
}
