//! Figures and tables of the reaching experiment, in the thesis' order.

use scrnn_sim::reach::agent::Decision;
use scrnn_sim::reach::channels::{REACHING, VISION};
use scrnn_sim::reach::stage::{CYCLE, PERIOD, POSITIONS};
use scrnn_sim::reach::touching::{Cycle, HandState};
use scrnn_sim::reach::tutor::Demonstration;
use scrnn_sim::world::scene::Scene;

use super::findings::{Driven, Findings, Material, channel};
use super::trials::{Found, Given, decided};
use crate::framework::JobResult;
use crate::framework::shapes::figure;
use scrnn_report::{Block, Chart, Panel, Picture, Pictures, Section, Series, Sheet, Tone, View};

/// Samples of the figures over time: five cycles.
const SHOWN: usize = 5 * CYCLE;

/// All sections: of the first seed, and the drivers of all.
pub fn sections(jobs: &[JobResult<Findings>], materials: &[Material]) -> Vec<Section> {
    let (Some(first), Some(material)) = (jobs.first(), materials.first()) else { return Vec::new() };
    let findings = &first.findings;
    let mut compared: Vec<Block> = jobs.iter().map(|job| drivers(job, jobs.len() > 1)).collect();
    compared.push(meaning());
    vec![
        Section {
            title: "Touching".into(),
            blocks: vec![over_time(material), snapshots(material), to_see_it(), touches(findings), shifts(findings)],
        },
        Section { title: "Generalisation".into(), blocks: vec![phase_plots(material)] },
        Section { title: "Variance over the cycle".into(), blocks: super::variance_page::blocks(&findings.variance) },
        Section { title: "Drivers compared".into(), blocks: compared },
    ]
}

/// How to see the robot move.
fn to_see_it() -> Block {
    let command = "scrnn simulate reach seed-1 --best --view reach.html";
    Block::Text(format!(
        "To see the robot at work, in 3-D, type this in the folder of this page and open reach.html: {command}"
    ))
}

/// The performances at the three positions.
fn at_positions(material: &Material) -> impl Iterator<Item = &Given> {
    material.performances.iter().step_by(2).map(|(_, given)| given)
}

/// The first demonstration at each position.
fn demonstrated(material: &Material) -> impl Iterator<Item = &Demonstration> {
    (0..POSITIONS.len()).filter_map(|k| material.demonstrations.iter().find(|one| one.position == k))
}

/// Touches as dots at a height, one for each cycle that is shown.
fn dots(cycles: &[Cycle], height: f64) -> Series {
    let touched = cycles.iter().filter(|cycle| cycle.touched).map(|cycle| cycle.touch.time / PERIOD);
    let points = touched.filter(|sample| *sample < SHOWN as f64).map(|sample| (sample, height)).collect();
    Series::dots("touch", Tone::Ink, points)
}

/// Fig. 4.4.
fn over_time(material: &Material) -> Block {
    let shown = [
        ("head pitch", "HeadPitch", Tone::Level(0)),
        ("shoulder pitch", "RShoulderPitch", Tone::Level(1)),
        ("elbow roll", "RElbowRoll", Tone::Level(2)),
    ];
    let mut panels = Vec::new();
    for (k, one) in demonstrated(material).enumerate() {
        let mut series: Vec<Series> = shown
            .iter()
            .map(|(name, joint, tone)| {
                let values = one.samples.iter().skip(channel(joint)).step_by(REACHING.len()).take(SHOWN);
                Series::line(*name, *tone, values.enumerate().map(|(k, value)| (k as f64, *value)).collect())
            })
            .collect();
        series.push(dots(&one.cycles, 1.7));
        panels
            .push(Panel { y: (-1.3, 1.8), ..Panel::spanning(format!("position {}: a demonstration", k + 1), series) });
    }
    let lines = |given: &Given, value: &dyn Fn(&Decision, usize) -> Option<f64>| -> Vec<Series> {
        let line = |(name, joint, tone): &(&str, &str, Tone)| {
            let points = decided(&given.performed.decisions[..SHOWN], |decision| value(decision, channel(joint)));
            Series::line(*name, *tone, points)
        };
        shown.iter().map(line).collect()
    };
    for (k, given) in at_positions(material).enumerate() {
        let output = |decision: &Decision, channel: usize| match channel.checked_sub(VISION) {
            Some(joint) => Some(decision.target[joint]),
            None => decision.mean.get(channel).copied(),
        };
        let mut series = lines(given, &output);
        series.push(dots(&given.performed.cycles, 1.7));
        panels.push(Panel {
            y: (-1.3, 1.8),
            ..Panel::spanning(format!("position {}: the network's output", k + 1), series)
        });
    }
    for (k, given) in at_positions(material).enumerate() {
        let series = lines(given, &|decision, channel| decision.variance.get(channel).copied());
        panels.push(Panel::spanning(format!("position {}: predicted variance", k + 1), series).with_zero());
    }
    let chart = Chart { columns: 3, aspect: 1.5, x_label: "sample".into(), y_label: "rad, rad\u{b2}".into(), panels };
    figure(
        "over-time",
        "Demonstration, output and predicted variance",
        "Five cycles at each position: what the robot sensed while it was taught, what the network predicted while it drove \
         the robot, with noise, and how large it predicted the noise to be. Dots mark touches.",
        "Fig. 4.4: the output has the structure of the data, and the variance is least at the moment of touching, largest \
         after the arm is retracted.",
        chart,
    )
}

/// The picture that was taken next to a moment.
fn picture(given: &Given, moment: Option<HandState>) -> Option<Scene> {
    let time = moment?.time;
    let off = |picture: &&(f64, Scene)| (picture.0 - time).abs();
    given.pictures.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map(|(_, scene)| scene.clone())
}

/// Fig. 4.5.
fn snapshots(material: &Material) -> Block {
    let row = |what: &str, moment: fn(&Cycle) -> Option<HandState>| -> Vec<Picture> {
        at_positions(material)
            .enumerate()
            .filter_map(|(k, given)| {
                let mut scenes =
                    given.performed.cycles.iter().take(10).filter_map(|cycle| picture(given, moment(cycle)));
                let scene = scenes.next()?;
                Some(Picture { title: format!("position {}: {what}", k + 1), scene, pale: scenes.collect() })
            })
            .collect()
    };
    let mut pictures = row("touch", |cycle| Some(cycle.touch));
    pictures.extend(row("retracted", |cycle| cycle.retraction));
    let view = View { eye: [0.72, -0.62, 0.80], target: [0.12, -0.06, 0.40] };
    figure(
        "snapshots",
        "Touching and retracted",
        "The robot at its first touch and after its first retraction, driven by the network with noise; pale hands are those of \
         the nine cycles that follow. At the touch they lie on each other.",
        "Fig. 4.5: the hand converges at the touch and diverges after it.",
        Pictures { columns: 3, view, pictures },
    )
}

/// Two channels over each other.
fn phase(title: String, points: Vec<(f64, f64)>, touches: Vec<(f64, f64)>, tone: Tone) -> Panel {
    let series = vec![Series::line("", tone, points), Series::dots("touch", Tone::Ink, touches)];
    Panel::spanning(title, series)
}

/// Samples nearest to touches.
fn touch_samples(cycles: &[Cycle]) -> impl Iterator<Item = usize> {
    cycles.iter().filter(|cycle| cycle.touched).map(|cycle| (cycle.touch.time / PERIOD).round() as usize)
}

/// Fig. 4.6.
fn phase_plots(material: &Material) -> Block {
    let names = ["1", "1-2", "2", "2-3", "3"];
    let pairs = [("shoulder", "RShoulderPitch", "RShoulderRoll"), ("elbow", "RElbowYaw", "RElbowRoll")];
    let mut panels = Vec::new();
    for (what, a, b) in pairs {
        let mut demonstrations = demonstrated(material);
        for (k, name) in names.iter().enumerate() {
            if k % 2 == 1 {
                panels.push(Panel {
                    title: String::new(),
                    x: (0.0, 1.0),
                    y: (0.0, 1.0),
                    series: Vec::new(),
                    failed: false,
                    equal: false,
                });
                continue;
            }
            let Some(one) = demonstrations.next() else { continue };
            let at = |sample: &[f64]| (sample[channel(a)], sample[channel(b)]);
            let points: Vec<(f64, f64)> = one.samples.chunks_exact(REACHING.len()).map(at).collect();
            let touches = touch_samples(&one.cycles).filter_map(|k| points.get(k).copied()).collect();
            panels.push(phase(format!("{what} data {name}"), points, touches, Tone::Data));
        }
    }
    for (what, a, b) in pairs {
        for ((_, given), name) in material.performances.iter().zip(names) {
            let at = |decision: &Decision| (decision.target[channel(a) - VISION], decision.target[channel(b) - VISION]);
            let points: Vec<(f64, f64)> = given.performed.decisions.iter().take(15 * CYCLE).map(at).collect();
            let touches = touch_samples(&given.performed.cycles).filter_map(|k| points.get(k.checked_sub(1)?).copied());
            let touches = touches.collect();
            panels.push(phase(format!("{what} output {name}"), points, touches, Tone::Ours));
        }
    }
    if let Some((a, b)) = two_units(material) {
        for ((_, given), name) in material.performances.iter().zip(names) {
            let at = |decision: &Decision| (decision.context[a], decision.context[b]);
            let points: Vec<(f64, f64)> = given.performed.decisions.iter().take(15 * CYCLE).map(at).collect();
            let touches = touch_samples(&given.performed.cycles).filter_map(|k| points.get(k.checked_sub(1)?).copied());
            let touches = touches.collect();
            panels.push(Panel {
                x: (-1.05, 1.05),
                y: (-1.05, 1.05),
                ..phase(format!("units {}, {}: {name}", a + 1, b + 1), points, touches, Tone::Ours)
            });
        }
    }
    let chart = Chart { columns: 5, aspect: 1.0, x_label: String::new(), y_label: String::new(), panels };
    figure(
        "phase-plots",
        "Phase plots",
        "Shoulder (roll over pitch) and elbow (roll over yaw) in a demonstration and in the network's output over 15 cycles, and \
         two context units, for positions 1 to 3 from right to left; half way between them (1-2, 2-3) nothing was taught. Dots mark touches.",
        "Fig. 4.6: trajectories converge at the touch and diverge after it, and those for new places lie between those of their \
         neighbours.",
        chart,
    )
}

/// The two context units that move most without moving alike.
fn two_units(material: &Material) -> Option<(usize, usize)> {
    let decisions: Vec<&Decision> =
        material.performances.iter().flat_map(|(_, given)| &given.performed.decisions).collect();
    let units = decisions.first()?.context.len();
    let column = |unit: usize| -> Vec<f64> { decisions.iter().map(|decision| decision.context[unit]).collect() };
    let variance = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
    };
    let columns: Vec<Vec<f64>> = (0..units).map(column).collect();
    let moves: Vec<f64> = columns.iter().map(|values| variance(values)).collect();
    let first = (0..units).max_by(|&a, &b| moves[a].total_cmp(&moves[b]))?;
    let apart = |unit: usize| {
        let alike = scrnn::evaluation::correlation(&columns[first], &columns[unit]).unwrap_or(1.0);
        moves[unit] * (1.0 - alike * alike)
    };
    let second = (0..units).filter(|&unit| unit != first).max_by(|&a, &b| apart(a).total_cmp(&apart(b)))?;
    Some((first, second))
}

fn millimetres(value: Option<f64>) -> String {
    value.map_or("\u{2013}".to_owned(), |metres| format!("{:.1}", 1e3 * metres))
}

fn place(index: usize) -> String {
    match index {
        0..3 => format!("position {}", index + 1),
        3 => "between 1 and 2".to_owned(),
        4 => "between 2 and 3".to_owned(),
        _ => "at random".to_owned(),
    }
}

fn found_row(name: String, found: &Found) -> Vec<String> {
    let ratio = found.spread_touch.zip(found.spread_retraction).map(|(touch, away)| touch / away);
    vec![
        name,
        format!("{:.0}", 1e3 * found.y),
        format!("{}", found.cycles),
        format!("{:.3}", found.rate()),
        millimetres(found.gap),
        millimetres(found.aim),
        millimetres(found.aim_95),
        millimetres(found.spread_touch),
        millimetres(found.spread_retraction),
        ratio.map_or("\u{2013}".to_owned(), |ratio| format!("{ratio:.3}")),
        found.period.map_or("\u{2013}".to_owned(), |period| format!("{period:.2}")),
    ]
}

/// Place by place, with predicted noise.
fn touches(findings: &Findings) -> Block {
    let head = [
        "place",
        "y, mm",
        "cycles",
        "touched",
        "gap, mm",
        "off, mm",
        "95 %",
        "spread, touch",
        "retracted",
        "ratio",
        "period",
    ];
    let mut rows = Vec::new();
    if let Some(noise) = findings.condition("noise") {
        rows.extend(noise.places.iter().enumerate().map(|(index, found)| found_row(place(index), found)));
    }
    Block::Sheet(Sheet {
        caption: "Thirty cycles at each place, predicted noise".into(),
        head: head.map(String::from).to_vec(),
        rows,
        note: "Touched: share of cycles in which hand and sphere came within 5 mm while the hand was within 15 mm of where it was \
               taught to be; cycles that are missing count as failures. Gap (negative in contact), distance off and spread at the \
               moment of the smallest gap, spread after retraction at the largest. The spread is the root mean square distance \
               from the mean place. The period is in samples of half a second."
            .into(),
    })
}

/// After shifts.
fn shifts(findings: &Findings) -> Block {
    let row = |shift: &super::trials::Shifted| {
        vec![
            format!("{:.0}", 1e3 * shift.from),
            format!("{:.0}", 1e3 * shift.to),
            shift.at.to_string(),
            shift.steps_to_adapt.map_or("\u{2013}".to_owned(), |steps| format!("{steps:.1}")),
            format!("{} of {}", shift.touched, shift.expected),
        ]
    };
    Block::Sheet(Sheet {
        caption: "The sphere is put elsewhere while the robot moves".into(),
        head: ["from, mm", "to, mm", "at sample", "samples to the first touch", "touched after that"].map(String::from).to_vec(),
        rows: findings.shifts.iter().map(row).collect(),
        note: "The first cycle at the new place may come too late, since the arm was already moving to the old one; it is left out of the \
               last column."
            .into(),
    })
}

/// The network beside what it is compared with.
fn drivers(job: &JobResult<Findings>, several: bool) -> Block {
    let share = |found: &[Found]| {
        let all: Vec<&Found> = found.iter().collect();
        if all.is_empty() { "\u{2013}".to_owned() } else { format!("{:.3}", super::trials::pooled_rate(&all)) }
    };
    let row = |condition: &Driven| {
        let between = condition.others().get(..2).unwrap_or_default();
        let random = condition.others().get(2..).unwrap_or_default();
        vec![
            condition.label.to_owned(),
            share(condition.learned()),
            share(between),
            share(random),
            format!("{:.3}", condition.rate),
            condition.spread_ratio.map_or("\u{2013}".to_owned(), |ratio| format!("{ratio:.3}")),
        ]
    };
    Block::Sheet(Sheet {
        caption: if several { format!("Touches per cycle, {}", job.called()) } else { "Touches per cycle".into() },
        head: ["driver", "learned positions", "half way", "at random", "all", "spread ratio"]
            .map(String::from)
            .to_vec(),
        rows: job.findings.conditions.iter().map(row).collect(),
        note: "Without noise nothing but the robot's own motors makes cycles differ; its spread ratio says little."
            .into(),
    })
}

fn meaning() -> Block {
    Block::Text(format!(
        "Replay plays the mean of the ten demonstrations at the nearest position and does not look at the sphere. GMM/GMR is \
         Gaussian mixture regression with {} components, as many numbers as the network has: it gets the metronome's phase, \
         which the network must keep by itself, and where the head looks.",
        super::trials::COMPONENTS
    ))
}
