//! An oscillator that is driven by noise which depends on its state (thesis 3.4).

mod page;

use scrnn::analysis::oscillation::Oscillation;
use scrnn::dataset::Dataset;
use scrnn::evaluation::correlation;
use scrnn::generation::{Feedback, Generated, GenerationOptions};
use scrnn::recognition::{RecognitionOptions, recognize};
use scrnn_report::Section;
use scrnn_run::assessment::{self, Assessment, Predictions};
use scrnn_tasks::limit_cycle::{self, State};
use serde::Serialize;

use crate::framework::preset::asset;
use crate::framework::{Condition, Desk, Job, Kind, Measure, Result, Results, Study, Verdict, closed_loop, held_out};

/// The S-CTRNN of the noise-driven oscillator.
const OSCILLATOR: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("limit_cycle.toml"), asset!("limit_cycle_fast.toml")] };
/// Steps of the closed loop that is shown and compared.
const STEPS: usize = 1000;
/// Steps of the closed loops, and of the oscillator itself, whose swings are measured: 40 000 cycles from 60 sequences, which tell
/// their spread to within 1 %.
const LONG: usize = 50_000;
/// A swing counts once y was this far below 0.
const BELOW: f64 = 0.2;

/// The experiment.
#[derive(Debug)]
pub struct LimitCycle;

/// The figures of one seed.
#[derive(Debug, Serialize)]
pub struct Findings {
    /// Correlation of predicted and true standard deviations, one step ahead of sequences that were not learned.
    pub sd_correlation_held_out: Option<f64>,
    /// The same on the learned sequences.
    pub sd_correlation_open: Option<f64>,
    /// In the closed loop with noise; the truth is (3.12) of the network's own output.
    pub sd_correlation_closed: Option<f64>,
    /// Swings of the network on its own; none if it does not swing.
    pub network: Option<Oscillation>,
    /// Swings of the oscillator itself over as many steps.
    pub oscillator: Option<Oscillation>,
    /// Swings of the sequences that were learned.
    pub learned: Option<Oscillation>,
    /// One step ahead.
    pub assessment: Assessment,
}

/// What figures are drawn from.
pub struct Material {
    /// The sequences that were learned.
    data: Dataset,
    /// Their hidden partner z.
    z: Dataset,
    /// The closed loop with noise, with contexts.
    closed: Vec<Generated>,
    /// Context units.
    units: usize,
}

/// (3.12) after a sample.
fn standard_deviation(y: f64) -> f64 {
    State { y, z: 0.0 }.standard_deviation()
}

impl Study for LimitCycle {
    type Findings = Findings;
    type Material = Material;

    fn title(&self) -> &'static str {
        "An oscillator driven by noise that depends on its state"
    }

    fn edition(&self) -> u32 {
        2
    }

    fn conditions(&self, _beyond: bool) -> Vec<Condition> {
        vec![Condition::only(&[OSCILLATOR])]
    }

    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Findings, Material)> {
        let &Job { networks, seed, .. } = job;
        let (learned, engine) = (&networks[0], desk.engine());
        let (network, data) = (&learned.network, &learned.source.data);
        let (delay, sequences) = (network.topology().delay(), data.sequences().len());
        let steps = data.sequences().iter().map(|sequence| sequence.len()).max().unwrap_or(0);
        let make = |steps, seed| limit_cycle::generate(&limit_cycle::Options { sequences, steps }, seed);
        let (own, new) = (make(steps, seed)?, make(STEPS, held_out(seed, 0))?);

        // New sequences have other phases: the network first listens to find where each of them starts.
        let options = RecognitionOptions::with(|it| {
            it.starts = 6;
            it.epochs = 100;
            it.seed = seed;
            it.initial_state_variance = learned.experiment.network.initial_state_variance;
        });
        let found: Vec<Vec<f64>> = desk.part("recognition", || {
            desk.say("recognition of new sequences");
            let found = recognize(network, &learned.initial_states, &new.task.data, &options, engine)?;
            Ok(found.into_iter().map(|mut found| found.trials.swap_remove(0).initial_state).collect())
        })?;
        let found: Vec<&[f64]> = found.iter().map(Vec::as_slice).collect();
        let on_learned = assessment::open_loop(network, &learned.states(), data, engine)?;
        let on_new = assessment::open_loop(network, &found, &new.task.data, engine)?;
        let run = |kind, steps, contexts| {
            let options = GenerationOptions::new(steps, Feedback::closed(1, true))
                .seed(closed_loop(seed, kind))
                .contexts(contexts);
            assessment::run(network, &learned.states(), data, &options, engine)
        };
        let closed = run(0, STEPS, true)?;

        // The deviation of each predicted sample follows from the sample before: a recorded or a generated one.
        let agree = |generated: &[Generated], before: &dyn Fn(usize, usize) -> f64, steps: &dyn Fn(usize) -> usize| {
            let (mut predicted, mut expected) = (Vec::new(), Vec::new());
            for (s, generated) in generated.iter().enumerate() {
                for k in 0..steps(s) {
                    predicted.push(generated.variance[k].sqrt());
                    expected.push(standard_deviation(before(s, k)));
                }
            }
            correlation(&predicted, &expected)
        };
        let recorded = |data: &'_ Dataset, s: usize, k: usize| data.sequences()[s].sample(k + delay - 1)[0];
        let before_own = |s: usize, k: usize| match k {
            0 => recorded(data, s, 0),
            _ => closed[s].sample[k - 1],
        };
        let swings =
            |signals: &[Generated]| Oscillation::of(signals.iter().map(|one| one.sample.as_slice()), 0.0, BELOW);
        let swings_of = |data: &Dataset| Oscillation::of(data.sequences().iter().map(|s| s.values()), 0.0, BELOW);
        let predictions = |generated: &[Generated], data: &Dataset| Predictions::of(generated, data, delay);
        let assessment =
            Assessment::new(data, &predictions(&on_learned, data), Some(&predictions(&on_new, &new.task.data)), delay);
        let length = |data: &Dataset, s: usize| data.sequences()[s].len() - delay;
        let findings = Findings {
            sd_correlation_held_out: agree(&on_new, &|s, k| recorded(&new.task.data, s, k), &|s| {
                length(&new.task.data, s)
            }),
            sd_correlation_open: agree(&on_learned, &|s, k| recorded(data, s, k), &|s| length(data, s)),
            sd_correlation_closed: agree(&closed, &before_own, &|_| STEPS),
            network: desk.part("swings of the network on its own", || Ok(swings(&run(1, LONG, false)?)))?,
            oscillator: desk
                .part("swings of the oscillator", || Ok(swings_of(&make(LONG, held_out(seed, 1))?.task.data)))?,
            learned: swings_of(data),
            assessment,
        };
        let units = network.topology().context_units();
        Ok((findings, Material { data: data.clone(), z: own.z, closed, units }))
    }

    fn measures(&self) -> Vec<Measure<Findings>> {
        let measure = Measure::<Findings>::new;
        vec![
            measure(
                "sd_correlation_held_out",
                "Correlation of standard deviations on new sequences",
                "predicted, one step ahead, against (3.12) of the recorded samples",
                "",
                4,
                |f| f.sd_correlation_held_out,
            ),
            measure(
                "sd_correlation_closed",
                "The same in the closed loop",
                "against (3.12) of the network's own output, 1000 steps",
                "\"close approximation\" (Fig. 3.7)",
                4,
                |f| f.sd_correlation_closed,
            ),
            measure(
                "cycles",
                "Cycles, % of the oscillator's",
                "in as many steps; few where the network comes to rest",
                "",
                0,
                |f| Some(100.0 * lively(f)),
            ),
            measure("amplitude_off", "Amplitude off by, %", "of the oscillator's mean amplitude", "", 1, |f| {
                off(f, |o| o.amplitude)
            }),
            measure(
                "amplitude_deviation_off",
                "Its spread off by, %",
                "standard deviation from cycle to cycle",
                "",
                1,
                |f| off(f, |o| o.amplitude_deviation),
            ),
            measure("period_off", "Period off by, %", "of the oscillator's mean period", "", 1, |f| {
                off(f, |o| o.period)
            }),
            measure(
                "period_deviation_off",
                "Its spread off by, %",
                "standard deviation from cycle to cycle",
                "",
                1,
                |f| off(f, |o| o.period_deviation),
            ),
            measure(
                "nll_held_out",
                "nll on new sequences",
                "nats per step, one step ahead; without a bound where the true variance is 0",
                "",
                3,
                |f| f.assessment.nll_held_out,
            ),
        ]
    }

    fn verdicts(&self, results: &Results<Findings>) -> Vec<Verdict> {
        let seeds = &results.jobs;
        vec![
            Verdict::every(seeds, "correlation of standard deviations, new sequences", "above 0.96", |seed| {
                let found = seed.findings.sd_correlation_held_out;
                (found.map_or("none".into(), |r| format!("{r:.4}")), found.is_some_and(|r| r > 0.96))
            }),
            Verdict::every(seeds, "amplitude, its spread, period, its spread", "each within 5 %", |seed| {
                let of = |part: fn(&Oscillation) -> f64| off(&seed.findings, part);
                let all =
                    [of(|o| o.amplitude), of(|o| o.amplitude_deviation), of(|o| o.period), of(|o| o.period_deviation)];
                let mut shown: Vec<String> =
                    all.iter().map(|off| off.map_or("none".into(), |off| format!("{off:+.1} %"))).collect();
                // A network that comes to rest is not to be judged by the few cycles before.
                let lively = lively(&seed.findings);
                if lively < 0.95 {
                    shown.push(format!("{:.0} % of the cycles", 100.0 * lively));
                }
                let met = lively >= 0.95 && all.iter().all(|off| off.is_some_and(|off| off.abs() <= 5.0));
                (shown.join(", "), met)
            }),
        ]
    }

    fn sections(&self, results: &Results<Findings>, materials: &[Material]) -> Vec<Section> {
        page::sections(&results.jobs, materials)
    }
}

/// By how many percent a part of the network's swings is larger than the oscillator's.
fn off(findings: &Findings, part: fn(&Oscillation) -> f64) -> Option<f64> {
    let (ours, truth) = (findings.network.as_ref()?, findings.oscillator.as_ref()?);
    Some(100.0 * (part(ours) / part(truth) - 1.0))
}

/// The network's cycles as a share of the oscillator's.
fn lively(findings: &Findings) -> f64 {
    let count = |swings: &Option<Oscillation>| swings.as_ref().map_or(0, |swings| swings.cycles) as f64;
    count(&findings.network) / count(&findings.oscillator).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framework::preset::Preset;

    #[test]
    fn the_thesis_preset_has_the_settings_of_3_4() {
        let experiment = OSCILLATOR.experiment(Preset::Thesis, 1, None, &[]).unwrap();
        let group = &experiment.network.groups[0];
        assert_eq!((group.units, group.time_constant, experiment.training.epochs), (10, 2.0, 500_000));
        assert_eq!(experiment.network.initial_state_variance, 1.0);
        let momentum = experiment.training.momentum.unwrap();
        assert_eq!((momentum.rate, momentum.momentum), (1e-4, 0.9));
        assert!(OSCILLATOR.experiment(Preset::Fast, 3, None, &[]).unwrap().network.variance);
    }
}
