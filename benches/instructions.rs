//! How many instructions six kernels and one epoch take, counted by callgrind and compared with what was recorded.
//!
//! ```text
//! cargo bench -p scrnn --no-default-features --bench instructions [-- --record | --time epoch/60x2x12x1000 [avx2]]
//! ```
//!
//! Clocks are noisy where other programs run; instructions are not. Each piece of work is run once with a number of calls
//! and once with twice as many, under valgrind, and the difference is what the calls take: start-up does not count. The
//! record (`benches/instructions.txt`) holds for one compiler: with another one differences are told, and do not fail.
//! Valgrind knows no AVX-512, so this is the AVX2 code.
//!
//! `--time` prints the seconds of one call by the clock instead, the least and the median, of any size: `forward/60x2x6` is units, channels and
//! columns, `epoch/60x2x12x1000` units, channels, sequences and steps (and, if a fifth number is given, threads). So two
//! builds of this program can take turns. `--time peak` is what the machine can do.

mod fixtures;
mod machine;
mod training;

use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use fixtures::{Elements, Kernel, Repeat, Size, values};
use machine::{median, on, peak_gflops, seconds_per_call};
use scrnn::engine::{Engine, InstructionSet};
use scrnn::generation::{Feedback, Running};
use scrnn::initialization::initialize;
use scrnn::topology::Topology;
use training::{Training, waves};

/// What is counted, with the calls of the shorter run.
const COUNTED: [(&str, u32); 7] = [
    ("forward/60x2x6", 200),
    ("forward/60x2x1", 500),
    ("backward/60x2x6", 200),
    ("backward/60x2x1", 500),
    ("gradient/60x2", 5),
    ("tanh/4096", 50),
    ("epoch/60x2x12x250", 1),
];
/// Counts may differ by this share.
const TOLERANCE: f64 = 0.03;
/// How to write the record anew.
const RECORD: &str = "cargo bench -p scrnn --no-default-features --bench instructions -- --record";
/// The instruction set whose code is counted.
const SET: InstructionSet = InstructionSet::Avx2;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments.as_slice() {
        [] => compare(),
        ["--record"] => record(),
        ["--calls", name, calls] => calls.parse().map_err(|_| "--calls NAME COUNT".to_owned()).and_then(|calls| {
            Work::new(name, SET)?.run(calls);
            Ok(())
        }),
        ["--time", name] => time(name, InstructionSet::best()),
        ["--time", name, set] => set.parse().map_err(|e| format!("{e}")).and_then(|set| time(name, set)),
        other => Err(format!("unknown arguments: {}; known: --record, --time NAME [SET]", other.join(" "))),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// A piece of work by its name.
enum Work {
    Product(fixtures::Fixture, Vec<f64>, InstructionSet),
    Gradient(fixtures::Outer, Vec<f64>, InstructionSet),
    Elements(Vec<f64>, bool, Vec<f64>, InstructionSet),
    Running(Box<Running>, usize),
    Epoch(Box<Training>),
}

impl Work {
    fn new(name: &str, set: InstructionSet) -> Result<Self, String> {
        let unknown = || format!("{name} is no piece of work; examples: {}", COUNTED.map(|(name, _)| name).join(", "));
        let (kind, sizes) = name.split_once('/').ok_or_else(unknown)?;
        let sizes: Vec<usize> = sizes.split('x').map(str::parse).collect::<Result<_, _>>().map_err(|_| unknown())?;
        let network = |units, channels| Topology::s_ctrnn(channels, units, 2.0).map_err(|e| e.to_string());
        let product = |kernel: fixtures::Fixture| {
            let out = values(kernel.len()).to_vec();
            Self::Product(kernel, out, set)
        };
        Ok(match (kind, sizes.as_slice()) {
            ("forward", &[units, channels, columns]) => product(Size { units, channels, columns }.forward(set)),
            ("backward", &[units, channels, columns]) => product(Size { units, channels, columns }.backward(set)),
            ("gradient", &[units, channels]) => {
                let kernel = Size::new(units, channels, 1).gradient();
                let out = values(kernel.len()).to_vec();
                Self::Gradient(kernel, out, set)
            }
            ("tanh" | "exp", &[count]) => {
                Self::Elements(values(count).to_vec(), kind == "tanh", values(count).to_vec(), set)
            }
            ("running", &[units, channels]) => {
                let (network, states) = initialize(&network(units, channels)?, 1, 1);
                let engine = Engine::new(1, set).map_err(|e| e.to_string())?;
                let feedback = Feedback::closed(channels, false);
                let running = Running::new(&network, states.sequence(0), feedback, 1, &engine);
                Self::Running(Box::new(running.map_err(|e| e.to_string())?), channels)
            }
            ("epoch", &[units, channels, sequences, steps, ref threads @ ..]) => {
                let topology = network(units, channels)?;
                let data = waves(&topology, sequences, steps);
                Self::Epoch(Box::new(Training::new(&topology, &data, *threads.first().unwrap_or(&1), set)))
            }
            _ => return Err(unknown()),
        })
    }

    fn run(&mut self, calls: u32) -> Duration {
        let start = Instant::now();
        match self {
            Self::Product(kernel, out, set) => on(*set, Repeat { kernel, out, calls }),
            Self::Gradient(kernel, out, set) => on(*set, Repeat { kernel, out, calls }),
            Self::Elements(source, hyperbolic, out, set) => {
                let kernel = Elements { source, hyperbolic: *hyperbolic };
                on(*set, Repeat { kernel: &kernel, out, calls });
            }
            Self::Running(running, channels) => {
                let nothing = vec![f64::NAN; *channels];
                (0..calls).for_each(|_| running.step(&nothing).expect("a sample of the network's size"));
            }
            Self::Epoch(training) => return training.time(u64::from(calls)),
        }
        start.elapsed()
    }
}

/// Prints the seconds of one call, the least and the median of some bursts; of `peak`, operations a second in units of 1e9.
fn time(name: &str, set: InstructionSet) -> Result<(), String> {
    if name == "peak" {
        let bursts: Vec<f64> = (0..15).map(|_| peak_gflops(set, 1)).collect();
        println!("{:.1} {:.1}", bursts.iter().copied().fold(0.0, f64::max), median(bursts));
        return Ok(());
    }
    let mut work = Work::new(name, set)?;
    let bursts: Vec<f64> = match &mut work {
        Work::Epoch(training) => {
            training.time(1);
            (0..7).map(|_| training.time(1).as_secs_f64()).collect()
        }
        work => {
            let burst = |work: &mut Work| {
                seconds_per_call(Duration::from_millis(4), |calls| {
                    work.run(calls);
                })
            };
            (0..15).map(|_| burst(work)).collect()
        }
    };
    println!("{:.4e} {:.4e}", bursts.iter().copied().fold(f64::INFINITY, f64::min), median(bursts));
    Ok(())
}

/// Instructions of one call.
fn count(name: &str, calls: u32) -> Result<f64, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let collected = |calls: u32| {
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(&program)
            .args(["--calls", name, &calls.to_string()])
            .output()
            .map_err(|e| e.to_string())?;
        let said = String::from_utf8_lossy(&output.stderr);
        let total = said.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse::<f64>().ok());
        match total {
            Some(total) if output.status.success() => Ok(total),
            _ => Err(format!("valgrind could not run {name}:\n{said}")),
        }
    };
    Ok((collected(2 * calls)? - collected(calls)?) / f64::from(calls))
}

/// Why nothing can be counted here, if so.
fn obstacle() -> Option<&'static str> {
    if !InstructionSet::available().contains(&SET) {
        return Some("this processor has no AVX2");
    }
    let version = Command::new("valgrind").arg("--version").output();
    (!version.is_ok_and(|output| output.status.success())).then_some("there is no valgrind (apt-get install valgrind)")
}

/// The compiler's name and version.
fn compiler() -> String {
    let output = Command::new("rustc").arg("--version").output();
    output.map_or("unknown".to_owned(), |output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn record_file() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../benches/instructions.txt")
}

/// Counts everything and writes it down.
fn record() -> Result<(), String> {
    if let Some(obstacle) = obstacle() {
        return Err(format!("nothing can be counted: {obstacle}"));
    }
    let mut text = format!("# Instructions of one call on AVX2. Written by: {RECORD}\ncompiler {}\n", compiler());
    for (name, calls) in COUNTED {
        let line = format!("{name} {:.0}\n", count(name, calls)?);
        print!("{line}");
        text += &line;
    }
    std::fs::write(record_file(), text).map_err(|e| format!("{}: {e}", record_file().display()))
}

/// Counts everything and compares it with the record.
fn compare() -> Result<(), String> {
    if let Some(obstacle) = obstacle() {
        println!("INSTRUCTIONS ARE NOT COUNTED: {obstacle}");
        return Ok(());
    }
    let text = std::fs::read_to_string(record_file()).map_err(|e| format!("{}: {e}", record_file().display()))?;
    let recorded = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    let (then, now) = (recorded("compiler").unwrap_or("unknown"), compiler());
    let mut changed = Vec::new();
    for (name, calls) in COUNTED {
        let before: f64 = recorded(name)
            .and_then(|value| value.parse().ok())
            .ok_or_else(|| format!("the record has no number for {name}; to write it: {RECORD}"))?;
        let after = count(name, calls)?;
        let change = after / before - 1.0;
        println!("{name:20} {before:12.0} recorded {after:12.0} now  {:+6.2} %", 100.0 * change);
        if change.abs() > TOLERANCE {
            let more = if change > 0.0 { "more" } else { "fewer" };
            changed.push(format!("{name} takes {:.1} % {more} instructions than recorded", 100.0 * change.abs()));
        }
    }
    if changed.is_empty() {
        return Ok(());
    }
    let changed = changed.join("\n");
    if then != now {
        println!("{changed}\nThe record was written with {then}, this is {now}: the difference may be the compiler's.");
        return Ok(());
    }
    Err(format!(
        "{changed}\nUp to {:.0} % is taken as the same. If the change is meant, say why in the commit, and write the record \
         anew: {RECORD}",
        100.0 * TOLERANCE
    ))
}
