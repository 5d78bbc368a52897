//! A sine wave whose noise changes over time (thesis 3.3).

use scrnn::dataset::Dataset;
use scrnn::evaluation::{correlation, half_mean_squared_error};
use scrnn::generation::{Feedback, Generated, GenerationOptions};
use scrnn_pages::calibration_blocks;
use scrnn_report::{Block, Chart, Figure, Panel, Section, Series, Tone};
use scrnn_run::assessment::{self, Assessment, Predictions};
use scrnn_tasks::{TaskName, make};
use serde::Serialize;

use crate::framework::preset::asset;
use crate::framework::shapes::over_time;
use crate::framework::{
    Condition, Desk, Job, JobResult, Kind, Measure, Result, Results, Study, Verdict, closed_loop, held_out,
};

/// The S-CTRNN of the sine wave.
const WAVE: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("sinusoid.toml"), asset!("sinusoid_fast.toml")] };
/// Steps of the closed loop.
const STEPS: usize = 1000;

/// The experiment.
#[derive(Debug)]
pub struct Sinusoid;

/// The figures of one seed.
#[derive(Debug, Serialize)]
pub struct Findings {
    /// Correlation of predicted and true standard deviations in the closed loop with noise.
    pub sd_correlation_closed: Option<f64>,
    /// The same one step ahead of new noise on the wave.
    pub sd_correlation_held_out: Option<f64>,
    /// The same on the learned sequence.
    pub sd_correlation_open: Option<f64>,
    /// Root mean squared distance of the closed loop's mean from the ideal wave.
    pub distance_closed: f64,
    /// |mean predicted variance - true| / true in the closed loop, over the 25 moments of the period.
    pub variance_error_mean: f64,
    /// One step ahead.
    pub assessment: Assessment,
}

/// What figures are drawn from.
pub struct Material {
    /// The sequence that was learned.
    pub data: Dataset,
    /// The closed loop with noise.
    pub closed: Generated,
    /// The true variance of each sample, as far as the closed loop runs.
    pub variances: Vec<f64>,
}

impl Study for Sinusoid {
    type Findings = Findings;
    type Material = Material;

    fn title(&self) -> &'static str {
        "A sine wave with noise that changes over time"
    }

    fn edition(&self) -> u32 {
        2
    }

    fn conditions(&self, _beyond: bool) -> Vec<Condition> {
        vec![Condition::only(&[WAVE])]
    }

    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Findings, Material)> {
        let &Job { networks, seed, .. } = job;
        let (learned, engine) = (&networks[0], desk.engine());
        let (network, data) = (&learned.network, &learned.source.data);
        let delay = network.topology().delay();
        let ideal = make(TaskName::Sinusoid, (1, STEPS + delay), seed, 1)?;
        let new = make(TaskName::Sinusoid, (1, STEPS), held_out(seed, 0), 1)?;
        let options = GenerationOptions::new(STEPS, Feedback::closed(1, true)).seed(closed_loop(seed, 0));
        let closed = assessment::run(network, &learned.states(), data, &options, engine)?.remove(0);
        let open = |data: &Dataset| assessment::open_loop(network, &learned.states(), data, engine);
        let (on_learned, on_new) = (open(data)?, open(&new.data)?);

        let deviations = |list: &[f64]| list.iter().map(|v| v.sqrt()).collect::<Vec<_>>();
        let agree = |generated: &Generated| {
            let truth = &ideal.variances.sequences()[0].values()[delay..];
            let steps = truth.len().min(generated.variance.len());
            correlation(&deviations(&generated.variance[..steps]), &deviations(&truth[..steps]))
        };
        let variances = ideal.variances.sequences()[0].values()[delay..].to_vec();
        let errors: Vec<f64> = (0..25)
            .map(|phase| {
                let own: Vec<f64> = closed.variance.iter().skip(phase).step_by(25).copied().collect();
                let mean = own.iter().sum::<f64>() / own.len() as f64;
                (mean - variances[phase]).abs() / variances[phase]
            })
            .collect();
        let predictions = |generated: &[Generated], data: &Dataset| Predictions::of(generated, data, delay);
        let mut assessment =
            Assessment::new(data, &predictions(&on_learned, data), Some(&predictions(&on_new, &new.data)), delay);
        if let Some(truth) = &learned.source.truth {
            assessment = assessment.with_truth(&truth.variances, delay);
        }
        let target = &ideal.means.sequences()[0].values()[delay..];
        let findings = Findings {
            sd_correlation_closed: agree(&closed),
            sd_correlation_held_out: agree(&on_new[0]),
            sd_correlation_open: agree(&on_learned[0]),
            distance_closed: (2.0 * half_mean_squared_error(target, &closed.mean)).sqrt(),
            variance_error_mean: errors.iter().sum::<f64>() / errors.len() as f64,
            assessment,
        };
        Ok((findings, Material { data: data.clone(), closed, variances }))
    }

    fn measures(&self) -> Vec<Measure<Findings>> {
        let measure = Measure::<Findings>::new;
        vec![
            measure(
                "sd_correlation_closed",
                "Correlation of standard deviations, closed loop",
                "predicted against true (3.7) over 1000 steps that the network runs on its own noisy output",
                "\"close\" (Fig. 3.6)",
                4,
                |f| f.sd_correlation_closed,
            ),
            measure(
                "sd_correlation_held_out",
                "The same on new noise",
                "one step ahead of a sequence that was not learned",
                "",
                4,
                |f| f.sd_correlation_held_out,
            ),
            measure(
                "variance_error_mean",
                "Error of predicted variances, %",
                "mean predicted variance at each of the period's 25 moments against the truth",
                "",
                1,
                |f| Some(100.0 * f.variance_error_mean),
            ),
            measure(
                "distance_closed",
                "Distance from the ideal wave",
                "root mean square of the closed loop's mean minus (3.6) without noise, at the right phase",
                "",
                4,
                |f| Some(f.distance_closed),
            ),
            measure(
                "nll_held_out",
                "nll on new noise",
                "nats per step, one step ahead; the noise's own entropy is -1.919",
                "",
                3,
                |f| f.assessment.nll_held_out,
            ),
        ]
    }

    fn verdicts(&self, results: &Results<Findings>) -> Vec<Verdict> {
        vec![Verdict::every(&results.jobs, "correlation of standard deviations, closed loop", "above 0.99", |seed| {
            let found = seed.findings.sd_correlation_closed;
            (found.map_or("none".into(), |r| format!("{r:.4}")), found.is_some_and(|r| r > 0.99))
        })]
    }

    fn sections(&self, results: &Results<Findings>, materials: &[Material]) -> Vec<Section> {
        let jobs = &results.jobs;
        let (Some(first), Some(material)) = (jobs.first(), materials.first()) else { return Vec::new() };
        let to = 150;
        let closed = |values: &[f64]| -> Vec<(f64, f64)> {
            (0..to.min(values.len())).map(|k| ((k + 2) as f64, values[k])).collect()
        };
        let wave = |title: &str, tone, points| {
            let panel = Panel::spanning(title, vec![Series::line("", tone, points)]);
            Panel { y: (-1.1, 1.1), ..panel }
        };
        let variance = |(job, material): (&JobResult<Findings>, &Material)| {
            let variances = vec![
                Series::line("predicted", Tone::Ours, closed(&material.closed.variance)),
                Series::line("true", Tone::Truth, closed(&material.variances)),
            ];
            let title = if jobs.len() > 1 { format!("variance, {}", job.called()) } else { "variance".to_owned() };
            Panel::spanning(title, variances).with_zero()
        };
        let mut panels = vec![
            wave("training data", Tone::Data, over_time(&material.data, 0, 0, to)),
            wave("output of the network on its own", Tone::Ours, closed(&material.closed.sample)),
        ];
        panels.extend(jobs.iter().zip(materials).map(variance));
        let chart = Chart { columns: 1, aspect: 3.6, x_label: "step".into(), y_label: String::new(), panels };
        let figure = Figure {
            file: "time".into(),
            title: "Data, output and variance".into(),
            caption: "Six periods of the data, of the closed loop with noise of the predicted variance, and of that variance \
                      beside the true one, for each seed. The network has no input that says how the noise grows and falls."
                .into(),
            thesis: "Fig. 3.6: the output has the noise of the data, and the predicted variance is close to the true one.".into(),
            drawing: chart.into(),
        };
        vec![
            Section { title: "Closed loop".into(), blocks: vec![Block::Figure(Box::new(figure))] },
            Section { title: "One step ahead".into(), blocks: calibration_blocks(&first.findings.assessment) },
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framework::preset::Preset;

    #[test]
    fn the_thesis_preset_has_the_settings_of_3_3() {
        let experiment = WAVE.experiment(Preset::Thesis, 1, None, &[]).unwrap();
        let group = &experiment.network.groups[0];
        assert_eq!((group.units, group.time_constant, experiment.training.epochs), (10, 2.0, 100_000));
        assert_eq!(experiment.network.initial_state_variance, 1.0);
        let momentum = experiment.training.momentum.unwrap();
        assert_eq!((momentum.rate, momentum.momentum), (1e-4, 0.9));
        for preset in [Preset::Thesis, Preset::Fast] {
            let experiment = WAVE.experiment(preset, 3, Some(7), &[]).unwrap();
            assert_eq!((experiment.seed, experiment.data.seed, experiment.training.epochs), (3, Some(3), 7));
            assert_eq!(serde_json::to_value(&experiment.data.scaling).unwrap(), "none");
        }
    }
}
