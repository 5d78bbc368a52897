//! Nothing is silent for more than two seconds, and Ctrl-C ends what takes long within two: data that robots make, evaluations, and the
//! trial of how long to learn.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::Place;
use crate::following::INTERACT;
use crate::reaching::REACH;

/// A command whose lines on stderr are noted with the time at which they came.
struct Watched {
    child: Child,
    begun: Instant,
    lines: Receiver<(Instant, String)>,
}

impl Watched {
    fn start(place: &Place, line: &str) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_scrnn"));
        command.current_dir(&place.0).args(line.split_whitespace()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (lines, coming) = channel();
        let said = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || {
            said.lines().map_while(Result::ok).try_for_each(|line| lines.send((Instant::now(), line)))
        });
        Self { child, begun: Instant::now(), lines: coming }
    }

    /// Waits for a line with this in it.
    fn until(&self, what: &str) {
        let mut seen = Vec::new();
        while let Ok((_, line)) = self.lines.recv_timeout(Duration::from_secs(120)) {
            if line.contains(what) {
                return;
            }
            seen.push(line);
        }
        panic!("never said {what:?}:\n{}", seen.join("\n"));
    }

    /// Interrupts it: how long it took to end, the code, and what was said after.
    #[cfg(unix)]
    fn interrupt(mut self) -> (Duration, Option<i32>, String) {
        Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        let asked = Instant::now();
        let code = self.child.wait().unwrap().code();
        let took = asked.elapsed();
        (took, code, self.lines.iter().map(|(_, line)| line).collect::<Vec<_>>().join("\n"))
    }

    /// Lets it end: the longest silence, how long it took, and all that was said.
    fn end(mut self) -> (Duration, Duration, Vec<String>) {
        assert!(self.child.wait().unwrap().success());
        let all = self.begun.elapsed();
        let said: Vec<(Instant, String)> = self.lines.iter().collect();
        let ends = [self.begun].into_iter().chain(said.iter().map(|(at, _)| *at)).chain([self.begun + all]);
        let ends: Vec<Instant> = ends.collect();
        let longest = ends.windows(2).map(|pair| pair[1].saturating_duration_since(pair[0])).max().unwrap();
        (longest, all, said.into_iter().map(|(_, line)| line).collect())
    }
}

/// Two seconds, and some for a machine that has other things to do.
const SILENCE: Duration = Duration::from_millis(3_500);
#[cfg(unix)]
const ENDED: Duration = Duration::from_secs(2);

/// Recordings of whole orders, which take a while.
fn orders() -> String {
    INTERACT.replace("sequences = 2\nsteps = 40", "sequences = 8\nsteps = 470")
}

#[test]
fn a_robot_that_makes_data_is_never_silent_for_long() {
    let place = Place::new();
    let (longest, all, said) = Watched::start(&place, "data interact --sequences 8 --threads 1 --out all.npz").end();
    assert!(longest < SILENCE, "silent for {longest:?}: {said:?}");
    let lines = said.iter().filter(|line| line.starts_with("making the data, ")).count();
    assert!(lines as u64 + 1 >= all.as_secs() / 4, "{lines} lines in {all:?}: {said:?}");
    let (_, _, said) = Watched::start(&place, "data interact --sequences 8 --threads 1 --out b.npz --quiet").end();
    assert_eq!(said, [""; 0]);
    assert!(place.read("all.npz") == place.read("b.npz"));
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_training_while_a_robot_makes_its_data() {
    for experiment in [orders(), REACH.replace("sequences = 3\nsteps = 30", "sequences = 60\nsteps = 180")] {
        let place = Place::with(&experiment);
        let watched = Watched::start(&place, "train sine.toml --out run --threads 1");
        watched.until("making the data, ");
        let (took, code, said) = watched.interrupt();
        assert!(took < ENDED && code == Some(130), "{took:?}, {code:?}: {said}");
        assert!(said.contains("interrupted before anything was learned"), "{said}");
        assert!(!place.path("run/checkpoint.safetensors").exists());
    }
}

#[cfg(unix)]
#[test]
fn a_reproduction_tells_what_it_is_at_and_ctrl_c_ends_it_there() {
    let place = Place::new();
    let line = "reproduce interact --epochs 5 --threads 1 --out pair";
    let watched = Watched::start(&place, line);
    watched.until("recordings of two robots");
    // Which one it is at, or how long it has been at it.
    watched.until("recording");
    let (took, code, said) = watched.interrupt();
    assert!(took < ENDED && code == Some(130), "{took:?}, {code:?}: {said}");
    assert!(said.contains("the same command goes on"), "{said}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_fit_of_the_mixture_that_reaching_is_compared_with() {
    let place = Place::new();
    let line = "reproduce reach --epochs 1 --out reach";
    let watched = Watched::start(&place, line);
    watched.until("a Gaussian mixture of 41 components");
    let (took, code, said) = watched.interrupt();
    assert!(took < ENDED && code == Some(130), "{took:?}, {code:?}: {said}");
    assert!(said.contains("the same command goes on"), "{said}");
    assert!(place.path("reach/seed-1/checkpoint.safetensors").exists() && !place.path("reach/report.html").exists());
}

#[cfg(unix)]
#[test]
fn the_trial_of_how_long_to_learn_tells_where_it_is_and_can_be_ended() {
    let place = Place::new();
    // Noisy waves, so that the recipe asks.
    let mut state = 1_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let rows = (0..20 * 400).map(|k| {
        let phase = f64::from(k % 400) / 12.0 * std::f64::consts::TAU;
        format!("{},{:.4},{:.4}\n", k / 400, phase.sin() + noise(), phase.cos() + noise())
    });
    place.write("noisy.csv", format!("sequence,a,b\n{}", rows.collect::<String>()));
    let watched = Watched::start(&place, "train noisy.csv --out run --threads 1");
    watched.until("finding out how long to learn");
    watched.until("how long to learn: epoch ");
    let (took, code, said) = watched.interrupt();
    assert!(took < ENDED && code == Some(130), "{took:?}, {code:?}: {said}");
}
