//! An oscillator that is driven by noise which depends on its state (thesis 3.4).

use scrnn::analysis::oscillation::Oscillation;
use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::evaluation::correlation;
use scrnn::generation::{Feedback, Generated, GenerationOptions};
use scrnn::recognition::{RecognitionOptions, recognize};
use scrnn_tasks::limit_cycle::{self, State};
use serde::Serialize;

use super::curves::{CLOSED_LOOP, HELD_OUT, timely};
use super::curves_page::{over_time, two_units};
use super::preset::{self, Kind};
use super::study::{Learned, Measure, SeedResult, Study, Verdict};
use scrnn_pages::calibration_blocks;
use scrnn_report::{Block, Chart, Figure, Panel, Section, Series, Sheet, Tone};
use scrnn_run::assessment::{self, Assessment, Predictions};
use scrnn_run::failure::Result;

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

    fn networks(&self) -> &'static [Kind] {
        &[preset::LIMIT_CYCLE]
    }

    fn evaluate(&self, networks: &[Learned], seed: u64, engine: &Engine) -> Result<(Findings, Material)> {
        let learned = &networks[0];
        let (network, data) = (&learned.network, &learned.source.data);
        let (delay, sequences) = (network.topology.delay(), data.sequences().len());
        let steps = data.sequences().iter().map(|sequence| sequence.len()).max().unwrap_or(0);
        let make = |steps, seed| limit_cycle::generate(&limit_cycle::Options { sequences, steps }, seed);
        let (own, new) = (make(steps, seed)?, make(STEPS, seed + HELD_OUT)?);

        // New sequences have other phases: the network first listens to find where each of them starts.
        let options = RecognitionOptions {
            starts: 6,
            epochs: 100,
            seed,
            initial_state_variance: learned.experiment.network.initial_state_variance,
            ..RecognitionOptions::default()
        };
        let found = recognize(network, &learned.initial_states, &new.task.data, &options, engine)?;
        let found: Vec<&[f64]> = found.iter().map(|found| found.trials[0].initial_state.as_slice()).collect();
        let on_learned = assessment::open_loop(network, &learned.states(), data, engine)?;
        let on_new = assessment::open_loop(network, &found, &new.task.data, engine)?;
        let run = |steps, contexts| {
            let options =
                GenerationOptions { steps, feedback: Feedback::closed(1, true), seed: seed + CLOSED_LOOP, contexts };
            assessment::run(network, &learned.states(), data, &options, engine)
        };
        let (closed, long) = (run(STEPS, true)?, run(LONG, false)?);

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
            network: swings(&long),
            oscillator: swings_of(&make(LONG, seed + HELD_OUT)?.task.data),
            learned: swings_of(data),
            assessment,
        };
        let units = network.topology.context_units();
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

    fn verdicts(&self, seeds: &[SeedResult<Findings>]) -> Vec<Verdict> {
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
            timely(seeds, 120.0),
        ]
    }

    fn sections(&self, seed: &SeedResult<Findings>, material: &Material) -> Vec<Section> {
        let blocks = vec![time(material), phase(material), swings(&seed.findings)];
        vec![
            Section { title: "Closed loop".into(), blocks },
            Section { title: "One step ahead".into(), blocks: calibration_blocks(&seed.findings.assessment) },
        ]
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

/// Fig. 3.7.
fn time(material: &Material) -> Block {
    let to = 300;
    let closed = &material.closed[0];
    let over = |values: &[f64]| -> Vec<(f64, f64)> { (0..to).map(|k| ((k + 2) as f64, values[k])).collect() };
    let first = material.data.sequences()[0].sample(0)[0];
    let before = std::iter::once(first).chain(closed.sample.iter().copied());
    let truth: Vec<f64> = before.take(to).map(|y| standard_deviation(y).powi(2)).collect();
    let wave = |title: &str, tone, points| {
        let panel = Panel::spanning(title, vec![Series::line("", tone, points)]);
        Panel { y: (-1.15, 1.15), ..panel }
    };
    let variances = vec![
        Series::line("predicted", Tone::Ours, over(&closed.variance)),
        Series::line("true, of the network's own output", Tone::Truth, over(&truth)),
    ];
    let panels = vec![
        wave("training data", Tone::Data, over_time(&material.data, 0, 0, to)),
        wave("output of the network on its own", Tone::Ours, over(&closed.sample)),
        Panel::spanning("variance", variances).with_zero(),
    ];
    let chart = Chart { columns: 1, aspect: 3.6, x_label: "step".into(), y_label: String::new(), panels };
    Block::Figure(Box::new(Figure {
        file: "time".into(),
        title: "Data, output and variance".into(),
        caption: "300 steps of the first sequence, of the closed loop with noise of the predicted variance, and of that variance \
                  beside the one that the oscillator would have at the network's output (3.12)."
            .into(),
        thesis: "Fig. 3.7: the output has the data's structure, and the predicted variance is close to the true one.".into(),
        drawing: chart.into(),
    }))
}

/// Fig. 3.8.
fn phase(material: &Material) -> Block {
    let steps = 800;
    let phase_plane = |title: &str, tone, points: Vec<(f64, f64)>| {
        let series = vec![Series::line("", tone, points)];
        Panel { title: title.into(), x: (-1.15, 1.15), y: (-1.0, 1.0), series, failed: false }
    };
    let (data, z) = (&material.data.sequences()[0], &material.z.sequences()[0]);
    let recorded = (0..steps.min(data.len())).map(|k| (data.sample(k)[0], z.sample(k)[0]));
    let closed = &material.closed[0];
    let mut panels = vec![
        phase_plane("A: data", Tone::Data, recorded.collect()),
        phase_plane(
            "B: network",
            Tone::Ours,
            partners(State { y: data.sample(0)[0], z: z.sample(0)[0] }, &closed.sample[..steps]),
        ),
    ];
    if let Some((a, b)) = two_units(&material.closed[..1], material.units) {
        let contexts = closed.contexts.chunks_exact(material.units).take(steps).map(|c| (c[a], c[b])).collect();
        panels.push(Panel::spanning(
            format!("C: units {}, {}", a + 1, b + 1),
            vec![Series::line("", Tone::Ours, contexts)],
        ));
    }
    let chart = Chart { columns: 3, aspect: 1.0, x_label: String::new(), y_label: String::new(), panels };
    Block::Figure(Box::new(Figure {
        file: "phase".into(),
        title: "Phase plots".into(),
        caption: "z over y for the data and for the network's closed loop, and two of its context units. The network never sees z: \
                  for its output z is computed by (3.10) from y, starting from that of the data."
            .into(),
        thesis: "Fig. 3.8: the output has the structure of the data, and the contexts share it.".into(),
        drawing: chart.into(),
    }))
}

/// y and z of a signal, z by (3.10) from the state before its first sample.
fn partners(start: State, signal: &[f64]) -> Vec<(f64, f64)> {
    let mut state = start;
    let next = |&y: &f64| {
        state = State { y, ..state.next() };
        (state.y, state.z)
    };
    signal.iter().map(next).collect()
}

fn swings(findings: &Findings) -> Block {
    let row = |name: &str, swings: &Option<Oscillation>| {
        let cells = swings.as_ref().map_or(vec!["\u{2013}".to_owned(); 3], |o| {
            vec![
                format!("{:.3} \u{b1} {:.3}", o.amplitude, o.amplitude_deviation),
                format!("{:.2} \u{b1} {:.2}", o.period, o.period_deviation),
                o.cycles.to_string(),
            ]
        });
        [vec![name.to_owned()], cells].concat()
    };
    Block::Sheet(Sheet {
        caption: "Swings, mean \u{b1} sd from cycle to cycle".into(),
        head: ["", "amplitude", "period in steps", "cycles"].map(String::from).to_vec(),
        rows: vec![
            row("the network on its own", &findings.network),
            row("the oscillator", &findings.oscillator),
            row("the learned sequences", &findings.learned),
        ],
        note: "A cycle lasts from one upward crossing of 0 to the next; its amplitude is half the distance between its highest and \
               lowest value. Network and oscillator run for 50000 steps from each sequence's start; the learned sequences are too short \
               to tell 5 % apart."
            .into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hidden_partner_is_found_again_from_what_is_seen() {
        let data = limit_cycle::generate(&limit_cycle::Options { sequences: 1, steps: 300 }, 3).unwrap();
        let (y, z) = (&data.task.data.sequences()[0], &data.z.sequences()[0]);
        let start = State { y: y.sample(0)[0], z: z.sample(0)[0] };
        let found = partners(start, &y.values()[1..]);
        for (k, point) in found.iter().enumerate() {
            assert_eq!(*point, (y.sample(k + 1)[0], z.sample(k + 1)[0]), "step {k}");
        }
    }
}
