//! Whether a run may go on: only if it would come to what it would have come to.

use std::path::Path;

use scrnn::checkpoint::Checkpoint;

use crate::experiment::{Difference, Experiment, OptimiserName, differences};
use crate::failure::{Failure, Result};
use crate::notes::Notes;

/// Most lengths of sequences that a message lists.
const MOST_LENGTHS: usize = 20;
const START_ANEW: &str = "start anew with --overwrite or in another folder with --out";

/// Compares what the checkpoint notes with `now`, and returns `now` with the best score so far.
///
/// # Errors
/// [`Failure::Refused`], with all differences.
pub fn check(checkpoint: &Checkpoint, now: Notes, experiment: &Experiment, path: &Path) -> Result<Notes> {
    let folder = path.display();
    let anew = format!("undo the change, or {START_ANEW}");
    let anew = anew.as_str();
    let Some(then) = Notes::of(checkpoint) else {
        return Err(Failure::refused(format!("the checkpoint in {folder} was not written by `scrnn train`"), anew));
    };
    // What is compared key by key is an experiment: anything else may have keys without end.
    if let Err(error) = then.experiment() {
        let message = format!("the experiment that the checkpoint in {folder} notes cannot be read: {error}");
        return Err(Failure::refused(message, anew));
    }
    let mut changes = differences(&then.experiment, &now.experiment);
    // Samples are compared, not where they lie.
    changes.retain(|change| change.key != "data.files" && change.key != "data.held_out.files");
    // It says when a training ends, not how it goes. A shorter one might have ended it before.
    let more = |change: &Difference| match (&change.old, &change.new) {
        (_, None) => true,
        (Some(old), Some(new)) => new.as_u64() >= old.as_u64(),
        (None, Some(_)) => false,
    };
    changes.retain(|change| change.key != "training.patience" || !more(change));
    // A run of a version that never reset a training gives the same result as long as no reset was needed.
    changes.retain(|change| change.key != "training.on_divergence" || change.old.is_some());
    let by_lbfgs = experiment.training.lbfgs.is_some();
    let by_momentum = experiment.training.optimiser == OptimiserName::Momentum && !by_lbfgs;
    let is_epochs = |change: &Difference| change.key == "training.epochs";
    if by_momentum && experiment.training.epochs >= checkpoint.epoch {
        // Momentum has no schedule: a longer run begins as a shorter one.
        changes.retain(|change| !is_epochs(change));
    }
    if !changes.is_empty() {
        let list: Vec<String> = changes.iter().map(|change| format!("  {change}")).collect();
        let message = format!("the experiment changed since the run in {folder} began:\n{}", list.join("\n"));
        let help = match changes.iter().any(is_epochs) {
            true if by_momentum => format!("the run is already at epoch {}", checkpoint.epoch),
            true if by_lbfgs => format!("the number of epochs decides where L-BFGS begins; {anew}"),
            true => format!("with adam the number of epochs shapes the rate from the first epoch on; {anew}"),
            false => anew.to_owned(),
        };
        return Err(Failure::refused(message, help));
    }
    if then.numerics != now.numerics {
        let message = format!(
            "the run in {folder} was computed by `{}`, and now it would be by `{}`",
            then.numerics, now.numerics
        );
        let help = format!("the two do not come to the same bits: go on as it began, or {START_ANEW}");
        return Err(Failure::refused(message, help));
    }
    // Earlier versions did not note ranges; the digest has them in it.
    if (&then.data.digest, &then.data.lengths) != (&now.data.digest, &now.data.lengths) {
        let mut message = format!("the data changed since the run in {folder} began:");
        if then.data.lengths != now.data.lengths {
            let list = |lengths: &[usize]| {
                let shown = lengths.iter().take(MOST_LENGTHS).map(ToString::to_string).collect::<Vec<_>>().join(", ");
                let more = lengths.len().saturating_sub(MOST_LENGTHS);
                if more > 0 { format!("{shown} and {more} more") } else { shown }
            };
            let (old, new) = (list(&then.data.lengths), list(&now.data.lengths));
            message += &format!("\n  samples in each sequence: {old} -> {new}");
        }
        let names = |notes: &Notes| notes.data.held_out.as_ref().map_or(Vec::new(), |held_out| held_out.names.clone());
        if names(&then) != names(&now) {
            message += &format!("\n  held out: {} -> {}", names(&then).join(", "), names(&now).join(", "));
        }
        let short = |digest: &str| digest.chars().take(12).collect::<String>();
        message += &format!("\n  digest: {} -> {}", short(&then.data.digest), short(&now.data.digest));
        return Err(Failure::refused(message, anew));
    }
    Ok(Notes { best: then.best, ..now })
}

#[cfg(test)]
mod tests {
    use scrnn::engine::Engine;
    use scrnn::initialization::initialize;
    use scrnn::learning::{Learner, OptimiserState, Plan};
    use scrnn::scaling::Scaling;

    use super::*;
    use crate::notes::{DataNotes, learned_part};

    #[test]
    fn a_run_goes_on_only_with_the_arithmetic_that_it_began_with() {
        let text = "name = \"x\"\n[data]\ntask = \"sinusoid\"\n[[network.groups]]\nname = \"context\"\nunits = 2\n\
                    time_constant = 2.0\n[training]\nepochs = 1\noptimiser = \"adam\"\n";
        let experiment = crate::experiment::read_text("x.toml", text, &[]).unwrap();
        let data = scrnn::dataset::Dataset::new(
            vec!["y".to_owned()],
            vec![scrnn::dataset::Sequence::new("a", 1, vec![0.1, 0.2, 0.3]).unwrap()],
        )
        .unwrap();
        let topology = experiment.topology(&data).unwrap();
        let (network, initial_states) = initialize(&topology, 1, 1);
        let learner = Learner::new(network, initial_states, &data, Plan::default(), &Engine::serial()).unwrap();
        let notes = |numerics: &str| Notes {
            experiment: learned_part(&experiment),
            data: DataNotes { digest: "0".to_owned(), lengths: vec![3], ranges: Vec::new(), held_out: None },
            variance_factor: None,
            numerics: numerics.to_owned(),
            score: None,
            best: None,
        };
        let then = |notes: &Notes| Checkpoint {
            topology: topology.clone(),
            parameters: learner.network().parameters().clone(),
            initial_states: learner.initial_states().clone(),
            scaling: Scaling::identity(1),
            channels: data.channels().to_vec(),
            sequences: vec!["a".to_owned()],
            first_inputs: vec![0.1],
            epoch: 0,
            optimiser: OptimiserState::default(),
            notes: notes.to_value(),
        };
        let check = |began: &str, now: &str| check(&then(&notes(began)), notes(now), &experiment, Path::new("runs/x"));
        // Earlier runs do not say, and were made with what is promised.
        assert_eq!(learner.numerics(), "f64");
        assert!(notes("f64").to_value().get("numerics").is_none());
        assert!(check("f64", learner.numerics()).is_ok() && check("gpu f32", "gpu f32").is_ok());
        for (began, now) in [("gpu f32", "f64"), ("f64", "gpu f32")] {
            let message = check(began, now).unwrap_err().to_string();
            assert!(message.contains(&format!("computed by `{began}`")) && message.contains(now), "{message}");
        }
    }
}
