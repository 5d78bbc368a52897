//! The targets on a stable compiler: seeds, changed at random but the same for the same number of runs.
//!
//! ```text
//! cargo run --release --example mutate -- TARGET RUNS SEED-FILES...
//! ```
//!
//! Without libFuzzer nobody looks which code a change reaches: what is found counts, what is not proves less.

use std::process::ExitCode;
use std::time::Instant;

/// Longest input, as with libFuzzer.
const LONGEST: usize = 8192;
/// Bytes and words that readers look for.
const WORDS: [&[u8]; 24] = [
    b"", b"\n", b",", b"\t", b";", b"\"", b"{", b"}", b"[", b"]", b":", b"\\", b"null", b"NaN", b"-Infinity", b"1e400",
    b"-1", b"18446744073709551615", b"\xff", b"\0", b"\"name\":", b"\"position\":", b"\"y\":", b"0",
];

/// splitmix64.
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound.max(1) as u64) as usize
    }

    /// One to six changes: a byte, a stretch that is cut, doubled or taken from another seed, a word.
    fn changed(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = seeds[self.below(seeds.len())].clone();
        for _ in 0..=self.below(6) {
            let at = self.below(bytes.len() + 1);
            let end = (at + self.below(40)).min(bytes.len());
            match self.below(6) {
                0 if at < bytes.len() => bytes[at] = self.below(256) as u8,
                1 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
                2 => drop(bytes.drain(at..end)),
                3 => drop(bytes.splice(at..at, bytes[at..end].to_vec())),
                4 => {
                    let other = &seeds[self.below(seeds.len())];
                    let from = self.below(other.len() + 1);
                    let to = (from + self.below(200)).min(other.len());
                    drop(bytes.splice(at..at, other[from..to].to_vec()));
                }
                _ => drop(bytes.splice(at..at, WORDS[self.below(WORDS.len())].to_vec())),
            }
        }
        bytes.truncate(LONGEST);
        bytes
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [target, runs, files @ ..] = arguments.as_slice() else {
        eprintln!("mutate TARGET RUNS SEED-FILES...");
        return ExitCode::from(2);
    };
    let read: fn(&[u8]) = match target.as_str() {
        "stream" => scrnn_fuzz::stream,
        "history" => scrnn_fuzz::history,
        "notes" => scrnn_fuzz::notes,
        "table" => scrnn_fuzz::table,
        "npy" => scrnn_fuzz::npy,
        "npz" => scrnn_fuzz::npz,
        "mcap" => scrnn_fuzz::mcap,
        "sqlite" => scrnn_fuzz::sqlite,
        "cdr" => scrnn_fuzz::cdr,
        "protobuf" => scrnn_fuzz::protobuf,
        "bag" => scrnn_fuzz::bag,
        "experiment" => scrnn_fuzz::experiment,
        "checkpoint" => scrnn_fuzz::checkpoint,
        "urdf" => scrnn_fuzz::urdf,
        "parquet" => scrnn_fuzz::parquet,
        "hdf5" => scrnn_fuzz::hdf5,
        "mat" => scrnn_fuzz::mat,
        "bvh" => scrnn_fuzz::bvh,
        "series" => scrnn_fuzz::series,
        other => {
            eprintln!("there is no target {other}");
            return ExitCode::from(2);
        }
    };
    let seeds: Vec<Vec<u8>> = files.iter().filter_map(|file| std::fs::read(file).ok()).collect();
    let (Ok(runs), false) = (runs.parse::<u64>(), seeds.is_empty()) else {
        eprintln!("a number of runs and files to begin with are needed");
        return ExitCode::from(2);
    };
    let (mut dice, begun, mut longest) = (Dice(1), Instant::now(), 0.0_f64);
    for run in 0..runs {
        let bytes = dice.changed(&seeds);
        let begin = Instant::now();
        if std::panic::catch_unwind(|| read(&bytes)).is_err() {
            eprintln!("run {run}: {:?}", String::from_utf8_lossy(&bytes));
            return ExitCode::FAILURE;
        }
        longest = longest.max(begin.elapsed().as_secs_f64());
    }
    println!("{target}: {runs} runs in {:.0} s, the longest {longest:.3} s", begun.elapsed().as_secs_f64());
    ExitCode::SUCCESS
}
