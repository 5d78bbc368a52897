//! Tests of working on a sweep within one process; `tests/sweeping.rs` has several, killed and interrupted.

use scrnn_run::messages::Progress;
use scrnn_run::run_folder::BEST;

use super::*;

const EXPERIMENT: &str = "name = \"sine\"\n[data]\ntask = \"sinusoid\"\nsteps = 40\n[[network.groups]]\nname = \"context\"\nunits = 4\n\
                          time_constant = 2.0\n[training]\nepochs = 30\noptimiser = \"adam\"\n";

struct Place(tempfile::TempDir);

impl Place {
    fn new(sweep: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("sine.toml"), EXPERIMENT).unwrap();
        std::fs::write(folder.path().join("s.toml"), format!("name = \"s\"\nexperiment = \"sine.toml\"\n{sweep}"))
            .unwrap();
        Self(folder)
    }

    fn out(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn work(&self, name: &str, options: &Options) -> Worked {
        let plan = Plan::read(&self.0.path().join("s.toml")).unwrap();
        let silent = |_: &str, _: u64| -> Box<dyn Progress> { Box::new(Silent) };
        let interrupt = Interrupt::new();
        let instruction_set = InstructionSet::best();
        let context =
            Context { threads: 2, instruction_set, interrupt: &interrupt, messages: &Silent, progress: &silent };
        work(&plan, &self.out(name), options, &context).unwrap()
    }
}

const SWEEP: &str = "seeds = 2\n[grid]\n\"training.adam.rate\" = [1e-3, 1e-2]\n[then.generate]\n[then.recognise]\nstarts = 2\nepochs = 5\n\
                     [then.follow]\nwindow = 5\niterations = 1\n";

#[test]
fn a_sweep_comes_to_the_same_bytes_in_shards_and_as_a_whole() {
    let place = Place::new(SWEEP);
    let worked = place.work("whole", &Options::default());
    assert_eq!((worked.runs, worked.finished, worked.failed.len()), (4, 4, 0), "{worked:?}");
    for shard in 1..=3 {
        place.work("parts", &Options { shard: (shard, 3), ..Options::default() });
    }
    for run in ["rate=1e-3/seed-1", "rate=0.01/seed-2"] {
        for name in [
            CHECKPOINT,
            BEST,
            OUTCOME,
            "generated.csv",
            "recognised.json",
            "followed.csv",
            "report.html",
            "experiment.toml",
        ] {
            let read = |out: &str| std::fs::read(place.out(out).join(run).join(name)).unwrap();
            assert!(read("whole") == read("parts"), "{run}/{name} differs");
        }
    }
    let outcome: Outcome = outcome::read(&place.out("whole").join("rate=0.01/seed-1"), OUTCOME).unwrap();
    for key in ["nll", "mse", "best.nll", "generate.distance", "recognise.error", "follow.error"] {
        assert!(outcome.measures.contains_key(key), "{key}: {outcome:?}");
    }
}

#[test]
fn what_is_finished_is_not_done_again_and_what_is_asked_for_anew_is() {
    let place = Place::new("seeds = 2\n[then]\nreport = false\n");
    place.work("out", &Options::default());
    let changed = || std::fs::metadata(place.out("out").join("seed-1").join(OUTCOME)).unwrap().modified().unwrap();
    let before = changed();
    assert_eq!(place.work("out", &Options::default()).finished, 2);
    assert_eq!(changed(), before);
    std::fs::write(
        place.0.path().join("s.toml"),
        "name = \"s\"\nexperiment = \"sine.toml\"\nseeds = 2\n[then.generate]\n",
    )
    .unwrap();
    assert_eq!(place.work("out", &Options::default()).finished, 2);
    assert!(changed() > before && place.out("out").join("seed-2/generated.csv").exists());
    // Another experiment in the same folder is refused, run by run, and nothing is lost.
    std::fs::write(place.0.path().join("sine.toml"), EXPERIMENT.replace("units = 4", "units = 5")).unwrap();
    let worked = place.work("out", &Options::default());
    assert_eq!((worked.finished, worked.failed.len()), (0, 2), "{worked:?}");
    assert!(worked.failed[0].1.message.contains("the experiment changed"), "{worked:?}");
    assert_eq!(worked.failed[0].1.code, 5);
}

#[test]
fn one_that_diverges_does_not_end_the_rest() {
    let place = Place::new(
        "seeds = 1\n[set]\ntraining.on_divergence = \"stop\"\n[grid]\n\"training.adam.rate\" = [1e-3, 1e6]\n",
    );
    let worked = place.work("out", &Options::default());
    assert_eq!((worked.finished, worked.diverged), (1, 1), "{worked:?}");
    let outcome: Outcome = outcome::read(&place.out("out").join("rate=1e6/seed-1"), OUTCOME).unwrap();
    assert!(outcome.outcome == Ended::Diverged && outcome.message.is_some(), "{outcome:?}");
    assert_eq!(place.work("out", &Options { retry: true, ..Options::default() }).diverged, 1);
}

#[test]
fn one_that_cannot_be_evaluated_is_told_and_tried_again() {
    let place = Place::new("[then.evaluate]\n");
    let worked = place.work("out", &Options::default());
    assert_eq!(worked.failed[0].1.code, 2);
    let failed: Failed = outcome::read(&place.out("out").join("seed-1"), FAILED).unwrap();
    assert!(failed.message.contains("holds no sequences out"), "{failed:?}");
    let experiment = EXPERIMENT.replace("steps = 40", "steps = 40\nsequences = 4\nheld_out = 0.3");
    std::fs::write(place.0.path().join("sine.toml"), experiment).unwrap();
    let worked = place.work("anew", &Options::default());
    assert_eq!(worked.finished, 1, "{worked:?}");
    let outcome: Outcome = outcome::read(&place.out("anew").join("seed-1"), OUTCOME).unwrap();
    assert!(
        outcome.measures.contains_key("evaluate.nll") && outcome.measures.contains_key("held_out.nll"),
        "{outcome:?}"
    );
}

#[test]
fn shards_that_there_are_not_and_folders_of_runs_are_refused() {
    let place = Place::new("");
    let plan = Plan::read(&place.0.path().join("s.toml")).unwrap();
    let silent = |_: &str, _: u64| -> Box<dyn Progress> { Box::new(Silent) };
    let (interrupt, instruction_set) = (Interrupt::new(), InstructionSet::best());
    let context = Context { threads: 1, instruction_set, interrupt: &interrupt, messages: &Silent, progress: &silent };
    for shard in [(0, 1), (3, 2)] {
        let options = Options { shard, ..Options::default() };
        assert_eq!(work(&plan, &place.out("out"), &options, &context).unwrap_err().code(), 2);
    }
    std::fs::create_dir(place.out("run")).unwrap();
    std::fs::write(place.out("run").join(CHECKPOINT), "").unwrap();
    assert_eq!(work(&plan, &place.out("run"), &Options::default(), &context).unwrap_err().code(), 5);
    // A wish to stop leaves everything as it is.
    interrupt.ask();
    let worked = work(&plan, &place.out("out"), &Options::default(), &context).unwrap();
    assert!(worked.interrupted && worked.finished == 0);
    assert_eq!(work_on(&plan, (&place.out("out"), 9), &Options::default(), &context).unwrap_err().code(), 2);
}
