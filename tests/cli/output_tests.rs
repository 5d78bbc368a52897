//! What goes to the terminal, and what ends in a broken pipe.

use super::*;

struct Broken(io::ErrorKind);

impl Write for Broken {
    fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
        Err(self.0.into())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn names_move_nothing_on_a_terminal() {
    assert_eq!(escaped("a\u{1b}]0;pwn\u{7}\u{9b}31m\u{202e}b\n\tc"), "a\\u{1b}]0;pwn\\u{7}\\u{9b}31m\\u{202e}b\n\tc");
    assert!(matches!(escaped("a name, \u{e4} \u{2192}\n"), Cow::Borrowed(_)));
}

#[test]
fn json_stays_json_of_the_same_strings() {
    let names = ["a\u{1b}]0;pwn\u{7}", "\u{7f}\u{9b}31m", "\u{202e}\u{2069}", "\u{e4} \u{2192} \u{1f600}"];
    let text = serde_json::to_string(&names).unwrap();
    let shown = escaped_in_json(&text);
    assert!(!shown.contains(moves) && shown.contains("\\u009b31m\", \"\\u202e".replace(", ", ",").as_str()), "{shown}");
    assert_eq!(serde_json::from_str::<Vec<String>>(&shown).unwrap(), names);
}

/// Takes two bytes at a time, and nothing in between.
struct Slow(Vec<u8>, bool);

impl Write for Slow {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.1 = !self.1;
        let taken = bytes.len().min(2);
        match self.1 {
            true => Err(io::ErrorKind::WouldBlock.into()),
            false => self.0.write(&bytes[..taken]),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_pipe_that_takes_little_at_a_time_gets_all() {
    let mut slow = Slow(Vec::new(), false);
    assert_eq!(write_to(&mut slow, "all of it").unwrap(), Reader::Listens);
    assert_eq!(slow.0, b"all of it");
}

#[test]
fn a_reader_that_left_is_no_failure_and_a_full_disk_is_one_with_its_own_code() {
    assert_eq!(write_to(&mut Vec::new(), "x").unwrap(), Reader::Listens);
    assert_eq!(write_to(&mut Broken(io::ErrorKind::BrokenPipe), "x").unwrap(), Reader::Left);
    assert_eq!(write_to(&mut Broken(io::ErrorKind::StorageFull), "x").unwrap_err().code(), 6);
}
