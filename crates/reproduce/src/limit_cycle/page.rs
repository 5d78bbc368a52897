//! Figures and tables of the oscillator (thesis 3.4).

use scrnn::analysis::oscillation::Oscillation;
use scrnn_pages::calibration_blocks;
use scrnn_report::{Block, Chart, Figure, Panel, Section, Series, Sheet, Tone};
use scrnn_tasks::limit_cycle::State;

use super::{Findings, Material, standard_deviation};
use crate::framework::JobResult;
use crate::framework::shapes::{over_time, two_units};

/// All sections: figures of the first seed, swings of all.
pub fn sections(jobs: &[JobResult<Findings>], materials: &[Material]) -> Vec<Section> {
    let (Some(first), Some(material)) = (jobs.first(), materials.first()) else { return Vec::new() };
    vec![
        Section { title: "Closed loop".into(), blocks: vec![time(material), phase(material), swings(jobs)] },
        Section { title: "One step ahead".into(), blocks: calibration_blocks(&first.findings.assessment) },
    ]
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
        Panel { title: title.into(), x: (-1.15, 1.15), y: (-1.0, 1.0), series, failed: false, equal: false }
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

/// Swings of the networks of all seeds beside those of the oscillator.
fn swings(jobs: &[JobResult<Findings>]) -> Block {
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
    let rows = |job: &JobResult<Findings>| {
        let findings = &job.findings;
        let of = |what: &str| if jobs.len() > 1 { format!("{}: {what}", job.called()) } else { what.to_owned() };
        [
            row(&of("the network on its own"), &findings.network),
            row(&of("the oscillator"), &findings.oscillator),
            row(&of("the learned sequences"), &findings.learned),
        ]
    };
    Block::Sheet(Sheet {
        caption: "Swings, mean \u{b1} sd from cycle to cycle".into(),
        head: ["", "amplitude", "period in steps", "cycles"].map(String::from).to_vec(),
        rows: jobs.iter().flat_map(rows).collect(),
        note: "A cycle lasts from one upward crossing of 0 to the next; its amplitude is half the distance between its highest and \
               lowest value. Network and oscillator run for 50000 steps from each sequence's start; the learned sequences are too short \
               to determine a spread within 5 %."
            .into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use scrnn_tasks::limit_cycle;

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
