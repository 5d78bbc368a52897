//! What the command line of a report asks for.

use scrnn::engine::InstructionSet;

/// The arguments behind `--`.
pub struct Arguments {
    given: Vec<String>,
    /// `--instruction-set NAME`, by default the fastest.
    pub set: InstructionSet,
    /// `--rounds N`: how often everything is measured. One round when cargo tests instead of measuring.
    pub rounds: usize,
}

impl Arguments {
    /// Reads them; `usual` rounds are made unless others are asked for.
    pub fn read(usual: usize) -> Self {
        let mut arguments = Self { given: std::env::args().collect(), set: InstructionSet::best(), rounds: usual };
        if let Some(name) = arguments.value("--instruction-set") {
            arguments.set = name.parse().unwrap_or_else(|error| panic!("{error}"));
        }
        if let Some(count) = arguments.value("--rounds") {
            arguments.rounds =
                count.parse().ok().filter(|&rounds| rounds > 0).expect("--rounds takes a number above 0");
        } else if !arguments.measures() {
            arguments.rounds = 1;
        }
        arguments
    }

    /// Whether this is `cargo bench`; `cargo test --benches` only looks whether a bench runs.
    pub fn measures(&self) -> bool {
        self.has("--bench")
    }

    /// Whether a flag was given.
    pub fn has(&self, name: &str) -> bool {
        self.given.iter().any(|argument| argument == name)
    }

    /// The value of an option.
    pub fn value(&self, name: &str) -> Option<&str> {
        let at = self.given.iter().position(|argument| argument == name)?;
        self.given.get(at + 1).map(String::as_str)
    }
}
