//! The sequences that a run did not learn, as a section of its page.

use scrnn_report::{Block, Section, Sheet};
use scrnn_run::evaluation::{ClosedLoop, LAGS, OneStep};
use scrnn_run::held_out::Judgement;

/// How the network does on the sequences that were held out.
pub fn section(judgement: &Judgement) -> Section {
    Section {
        title: "Sequences that were not learned".into(),
        blocks: vec![Block::Sheet(ahead(judgement)), Block::Sheet(alone(judgement))],
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn shown(value: Option<f64>) -> String {
    value.map_or("\u{2013}".to_owned(), |value| format!("{value:.4}"))
}

/// One step ahead, beside simple models.
fn ahead(judgement: &Judgement) -> Sheet {
    let row = |name: String, one: &OneStep| vec![name, shown(one.nll), format!("{:.3e}", one.mse)];
    let mut rows = vec![
        row(
            format!("from the mean initial state, after the first {}", percent(judgement.burn_in)),
            &judgement.from_mean,
        ),
        row(
            format!("from the state recognised in the first {0}, after the first {0}", percent(judgement.observed)),
            &judgement.from_recognised,
        ),
        row("always the channel's mean and variance".into(), &judgement.constant),
    ];
    rows.extend(judgement.linear.iter().map(|one| row(format!("linear in the last {LAGS} samples"), one)));
    Sheet {
        caption: "One step ahead".into(),
        head: ["", "nll", "squared error"].map(String::from).to_vec(),
        rows,
        note: format!(
            "Per step and channel, in scaled units, on {}. The simple models were fitted to the learned sequences.",
            judgement.sequences.join(", ")
        ),
    }
}

/// The closed loop after what was heard.
fn alone(judgement: &Judgement) -> Sheet {
    let both = [&judgement.closed_loop, &judgement.closed_loop_from_recognised];
    let row =
        |name: String, of: &dyn Fn(&ClosedLoop) -> Option<f64>| vec![name, shown(of(both[0])), shown(of(both[1]))];
    let mut rows = Vec::new();
    for (k, after) in judgement.closed_loop.after.iter().enumerate() {
        let steps = if after.steps == 1 { "step" } else { "steps" };
        rows.push(row(format!("distance after {} {steps}", after.steps), &|one| one.after[k].distance));
    }
    rows.push(row("distance at the end".into(), &|one| Some(one.end)));
    rows.push(row("distance over all of it".into(), &|one| Some(one.distance)));
    rows.push(row("the same of the channels' means".into(), &|one| Some(one.distance_of_constant)));
    rows.push(row("nll".into(), &|one| one.nll));
    rows.push(row("share within one sd (Gaussian 0.68)".into(), &|one| one.within_one));
    rows.push(row("share within two sd (Gaussian 0.95)".into(), &|one| one.within_two));
    let verdict = match judgement.closed_loop.leaves_the_data() {
        true => " Its closed loop leaves the data: the channels' means are nearer to them.",
        false => "",
    };
    Sheet {
        caption: format!("Alone after the first {}", percent(judgement.observed)),
        head: ["", "from the mean state", "from the recognised state"].map(String::from).to_vec(),
        rows,
        note: format!(
            "Root mean squared distances per channel, in scaled units, from the moments of several loops with noise of their \
             own.{verdict}"
        ),
    }
}
