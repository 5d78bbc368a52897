//! Experiment files that are damaged: read, or refused with a message, never a panic. Seeded, so that a failure comes again.

use std::path::Path;

use super::*;

/// Numbers that look random (splitmix64).
struct Dice(u64);

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

const GOOD: [&str; 3] = [
    include_str!("../../../../assets/experiments/sinusoid.toml"),
    include_str!("../../../../assets/experiments/limit_cycle_fast.toml"),
    "name = \"m\"\n[data]\nfiles = [\"a.mcap\"]\ntopic = \"/t\"\nperiod = 0.1\nchannels = [\"a\", \"b\"]\n\
     scaling = { ranges = [[0, 1], [2, 3]] }\n[[network.groups]]\nname = \"c\"\nunits = 3\ntime_constant = 2.0\n\
     [training]\nepochs = 3\noptimiser = \"momentum\"\non_divergence = \"stop\"\n[training.momentum.adaptive_rate]\n",
];

const PIECES: &str = "= [ ] { } \" ''' \"\"\" . , # [[ ]] \n 0 -1 1e999 nan inf 99999999999999999999 0x7fffffffffffffff true \u{e9} \
    name seed data network groups units training epochs optimiser adam momentum rate \"fit\" scaling offset 1979-05-27";

#[test]
fn a_damaged_experiment_is_read_or_refused_and_never_a_panic() {
    let pieces: Vec<&str> = PIECES.split(' ').collect();
    let mut dice = Dice(1);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..6000 {
        let mut text: Vec<char> = GOOD[dice.below(GOOD.len())].chars().collect();
        for _ in 0..=dice.below(3) {
            let at = dice.below(text.len());
            match dice.below(4) {
                0 => drop(text.remove(at)),
                1 => drop(text.splice(at..at, pieces[dice.below(pieces.len())].chars())),
                2 => drop(
                    text.splice(at..text.len().min(at + 1 + dice.below(30)), pieces[dice.below(pieces.len())].chars()),
                ),
                _ => text[at] = char::from(32 + dice.below(95) as u8),
            }
            if text.is_empty() {
                text.push(' ');
            }
        }
        let text: String = text.into_iter().collect();
        let change: Override = "training.epochs=7".parse().unwrap();
        let overrides: &[Override] = if dice.below(2) == 0 { &[] } else { &[change] };
        match read_text("x.toml", &text, overrides) {
            Ok(experiment) => {
                read += 1;
                let resolved = experiment.resolved(Path::new("/")).unwrap();
                let again = toml::to_string(&resolved).unwrap();
                assert_eq!(read_text("again.toml", &again, &[]).unwrap(), resolved, "{again}");
                let _ = (resolved.plan(), resolved.bare_topology(2));
            }
            Err(failure) => {
                refused += 1;
                assert_eq!(failure.code(), 2);
                assert!(!format!("{:?}", miette::Report::new(failure)).is_empty());
            }
        }
    }
    assert!(read > 300 && refused > 300, "{read} read, {refused} refused");
}
