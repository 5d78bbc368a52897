//! What replacing leaves: the new bytes, in the old place, and nothing else.

use super::*;

#[test]
fn a_file_is_replaced_and_nothing_else_is_left_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.csv");
    replace(&path, b"old").unwrap();
    replace(&path, b"new").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn permissions_are_those_of_any_new_file_or_of_the_one_that_was_there() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
    replace(&ours, b"").unwrap();
    fs::write(&plain, "").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o7777;
    assert_eq!(mode(&ours), mode(&plain));
    fs::set_permissions(&ours, PermissionsExt::from_mode(0o600)).unwrap();
    replace(&ours, b"secret").unwrap();
    assert_eq!((mode(&ours), fs::read(&ours).unwrap()), (0o600, b"secret".to_vec()));
}

#[cfg(unix)]
#[test]
fn links_are_followed_to_files_that_are_there_and_that_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::create_dir(place("far")).unwrap();
    fs::write(place("far/real"), "old").unwrap();
    std::os::unix::fs::symlink("far/real", place("link")).unwrap();
    std::os::unix::fs::symlink("link", place("second")).unwrap();
    std::os::unix::fs::symlink("far/new", place("dangling")).unwrap();
    replace(&place("second"), b"one").unwrap();
    replace(&place("dangling"), b"two").unwrap();
    assert!(["link", "second", "dangling"].iter().all(|link| place(link).is_symlink()));
    assert_eq!([fs::read(place("far/real")).unwrap(), fs::read(place("far/new")).unwrap()], [b"one", b"two"]);
    std::os::unix::fs::symlink("round", place("round")).unwrap();
    assert!(replace(&place("round"), b"").unwrap_err().to_string().starts_with("cannot write"));
}

#[cfg(target_os = "linux")]
#[test]
fn devices_and_fifos_are_written_to_and_stay_what_they_are() {
    use std::os::unix::fs::FileTypeExt;
    replace(Path::new("/dev/null"), b"gone").unwrap();
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    assert!(replace(Path::new("/dev/full"), b"x").is_err());
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let reader = std::thread::spawn({
        let fifo = fifo.clone();
        move || fs::read(fifo).unwrap()
    });
    replace(&fifo, b"through").unwrap();
    assert_eq!(reader.join().unwrap(), b"through");
    assert!(fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo());
}

#[test]
fn what_a_writer_that_is_gone_left_is_swept_and_what_a_living_one_writes_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: String| folder.path().join(name);
    // No process has this number: Linux ends at 2^22.
    let gone = place(format!("{HALF_WRITTEN}{}-abc", u32::MAX));
    let older = place(format!("{HALF_WRITTEN}abc"));
    let ours = place(format!("{HALF_WRITTEN}{}-abc", std::process::id()));
    let held = place(format!("{HALF_WRITTEN}{}-def", u32::MAX));
    let other = place("data.csv".to_owned());
    for path in [&gone, &older, &ours, &held, &other] {
        fs::write(path, "half").unwrap();
    }
    let holder = File::open(&held).unwrap();
    holder.try_lock().unwrap();
    replace(&place("new.csv".to_owned()), b"new").unwrap();
    assert!(!older.exists() && ours.exists() && held.exists() && other.exists());
    #[cfg(target_os = "linux")]
    assert!(!gone.exists());
    // A number that was given to another process does not keep a file for ever.
    drop(holder);
    File::options()
        .write(true)
        .open(&ours)
        .unwrap()
        .set_modified(std::time::SystemTime::now() - 2 * ABANDONED)
        .unwrap();
    sweep(folder.path()).unwrap();
    assert!(!ours.exists());
}

#[test]
fn one_file_is_known_by_every_path() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::create_dir(place("in")).unwrap();
    assert!(is_one_file(&place("a.csv"), &place("in/../a.csv")));
    assert!(!is_one_file(&place("a.csv"), &place("b.csv")) && !is_one_file(&place("none/a"), &place("none/b")));
    fs::write(place("a.csv"), "").unwrap();
    assert!(is_one_file(&place("a.csv"), &place("in/../a.csv")));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a.csv", place("link")).unwrap();
        assert!(is_one_file(&place("a.csv"), &place("link")));
        assert!(!is_one_file(Path::new("/dev/null"), Path::new("/dev/null")));
    }
}

#[test]
fn a_missing_folder_is_reported_with_the_path_that_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none").join("data.csv");
    let error = replace(&path, b"").unwrap_err();
    assert_eq!(error.to_string(), format!("cannot write {}", path.display()));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
