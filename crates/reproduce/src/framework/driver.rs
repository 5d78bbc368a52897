//! From options to a page: trains and evaluates a study's jobs side by side, and puts them together.

use std::path::{Path, PathBuf};
use std::time::Instant;

use scrnn::engine::Engine;
use scrnn::jobs::side_by_side;
use scrnn::learning::Outcome;
use scrnn_report::PAGE;
use scrnn_run::experiment::Experiment;
use scrnn_run::failure::{Ending, Failure};
use scrnn_run::history;
use scrnn_run::run_folder::{CHECKPOINT, HISTORY, RunFolder};
use scrnn_run::training::{Found, Training, train};

use super::condition::Condition;
use super::context::Context;
use super::desk::Desk;
use super::film::{self, Film};
use super::job_result::{JobResult, TrainingFacts};
use super::kept::{Decides, EVALUATION, Kept};
use super::measure::{Measure, Summary};
use super::metrics::{METRICS, Machine, Metrics};
use super::options::{Options, Reproduced};
use super::preset::Kind;
use super::results::Results;
use super::stop::{Result, Stop};
use super::study::{Job, Learned, Study};
use super::{overview, printout};

/// One job and its results.
struct Done<S: Study> {
    result: JobResult<S::Findings>,
    networks: Vec<Learned>,
    material: S::Material,
    films: Vec<Film>,
}

/// Reproduces the experiment called `name`.
///
/// # Errors
/// What is wrong with the settings, and whatever the disk refuses.
pub fn reproduce<S: Study>(
    name: &'static str,
    study: &S,
    options: &Options,
    context: &Context<'_>,
) -> scrnn_run::failure::Result<Reproduced> {
    match (Reproduction { name, study, options, context }).run() {
        Ok(reproduced) => Ok(reproduced),
        Err(Stop::Failed(failure)) => Err(failure),
        Err(Stop::Interrupted) => {
            let message = "interrupted: what was learned and evaluated is saved, and the same command goes on with it";
            context.messages.say(message);
            Ok(Reproduced { ending: Ending::Interrupted, json: String::new(), text: String::new() })
        }
    }
}

/// A study with all that it is run with.
struct Reproduction<'a, S> {
    name: &'static str,
    study: &'a S,
    options: &'a Options,
    context: &'a Context<'a>,
}

impl<S: Study> Reproduction<'_, S> {
    fn run(&self) -> Result<Reproduced> {
        let begun = Instant::now();
        let &Self { study, options, context, .. } = self;
        let folder = self.open()?;
        let path = std::path::absolute(folder.path()).map_err(|error| Failure::disk("find", folder.path(), error))?;
        let conditions = study.conditions(options.beyond);

        let serial = Engine::serial();
        let desk = Desk::new(&serial, (context.interrupt, context.messages), self.name, None);
        study.prepare(&conditions, &path, context.threads, &desk)?;

        // Conditions take turns, so that whatever is interrupted has networks of each.
        let places: Vec<(usize, u64)> = (0..options.seeds)
            .flat_map(|k| (0..conditions.len()).map(move |condition| (condition, k)))
            .filter(|&(condition, k)| conditions[condition].most.is_none_or(|most| k < most))
            .collect();
        let one = |place: usize, threads: usize| {
            let (condition, k) = places[place];
            self.job(&path, &conditions[condition], (options.seed.saturating_add(k), k == 0), threads)
        };
        let mut done: Vec<Option<Done<S>>> =
            side_by_side(places.len(), context.threads, one)?.into_iter().map(Some).collect();

        let (mut jobs, mut networks, mut materials, mut films) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for wanted in 0..conditions.len() {
            for (&(condition, _), done) in places.iter().zip(&mut done) {
                if let Some(Done { result, networks: own, material, films: shot }) =
                    done.take_if(|_| condition == wanted)
                {
                    jobs.push(result);
                    networks.push(own);
                    materials.push(material);
                    films.extend(shot);
                }
            }
        }
        let results = self.put_together(conditions, jobs, &networks);
        let metrics = Metrics {
            format: 2,
            experiment: self.name,
            preset: options.preset.word(),
            command: options.command(self.name),
            version: env!("CARGO_PKG_VERSION"),
            machine: Machine::here(context.threads, context.instruction_set),
            seconds: begun.elapsed().as_secs_f64(),
            verdicts: study.verdicts(&results),
            results: &results,
        };
        let page = overview::page(study, &metrics, (&networks, &materials), film::write(&films, &folder)?);
        let text = metrics.json();
        folder.write(METRICS, text.as_bytes())?;
        scrnn_pages::write(&page, folder.path())?;
        let diverged = results.jobs.iter().flat_map(|job| &job.trainings).filter_map(|facts| facts.diverged.as_ref());
        let mut ending = Ending::Done;
        for sentence in diverged {
            context.messages.say(&format!("{sentence}; the page speaks of the last good epoch"));
            ending = Ending::Diverged;
        }
        Ok(Reproduced { ending, json: text, text: printout::text(&metrics, folder.path()) })
    }

    /// The folder of the whole reproduction.
    fn open(&self) -> Result<RunFolder> {
        let usual = || Path::new("runs/reproduce").join(format!("{}-{}", self.name, self.options.preset.word()));
        let path: PathBuf = self.options.out.clone().unwrap_or_else(usual);
        let folder = RunFolder::open(&path)?;
        if self.options.overwrite {
            // A page that is there would speak of trainings that are not.
            folder.remove(PAGE)?;
            folder.remove(METRICS)?;
        }
        Ok(folder)
    }

    /// Trains and evaluates one job.
    fn job(&self, path: &Path, condition: &Condition, (seed, first): (u64, bool), threads: usize) -> Result<Done<S>> {
        let &Self { study, options, context, .. } = self;
        let engine = Engine::new(threads, context.instruction_set)?;
        let mut networks = Vec::new();
        for (index, kind) in condition.networks.iter().enumerate() {
            let experiment = study.experiment(condition, index, seed, options, path)?;
            let run = condition.run(seed, kind);
            let label = match condition.key {
                "" => format!("seed {seed}, {}: ", kind.called(&experiment)),
                _ => format!("{run}: "),
            };
            let progress = (context.progress)(&label, experiment.training.epochs);
            let found = if options.overwrite { Found::Overwrite } else { Found::GoOn };
            let place = path.join(&run);
            let training =
                train(&experiment, (&place, found), (&engine, context.interrupt), progress, context.messages)?;
            if training.outcome == Outcome::Stopped {
                return Err(Stop::Interrupted);
            }
            networks.push(learned(kind, run, experiment, training, &place)?);
        }
        let trained: f64 = networks.iter().map(|network| network.training.seconds).sum();

        let place = path.join(condition.run(seed, &condition.networks[0]));
        if options.overwrite {
            std::fs::remove_file(place.join(EVALUATION)).ok();
        }
        let kept = Kept::open(&place, self.decided_by(path, condition, seed, &networks)?);
        let label = match condition.key {
            "" => format!("seed {seed}"),
            key => format!("{key}-{seed}"),
        };
        let desk = Desk::new(&engine, (context.interrupt, context.messages), &label, Some(kept));
        desk.say("generating, recognising, evaluating");
        let clock = Instant::now();
        let job = Job { condition, seed, first, networks: &networks };
        let (findings, material) = study.evaluate(&job, &desk)?;
        desk.go_on()?;
        let films = study.films(&job, &desk)?;
        // Others may still be at work: what is said of the time that passes is no longer about this one.
        desk.say("evaluated");
        let evaluated = clock.elapsed().as_secs_f64() + desk.saved();
        let result = JobResult {
            condition: Some(condition.key).filter(|key| !key.is_empty()),
            seed,
            seconds: trained + evaluated,
            seconds_of_evaluation: evaluated,
            threads,
            trainings: networks.iter().map(|network| network.training.clone()).collect(),
            findings,
        };
        Ok(Done { result, networks, material, films })
    }

    /// Everything that decides the result of an evaluation. A checkpoint knows the digest of the data that it learned.
    fn decided_by(&self, path: &Path, condition: &Condition, seed: u64, networks: &[Learned]) -> Result<String> {
        let mut decides = Decides::default();
        let edition = self.study.edition().to_string();
        for text in [env!("CARGO_PKG_VERSION"), self.name, &edition, condition.key, &seed.to_string()] {
            decides.add(text.as_bytes());
        }
        for network in networks {
            let file = path.join(&network.training.folder).join(CHECKPOINT);
            let bytes = std::fs::read(&file).map_err(|error| Failure::disk("read", &file, error))?;
            decides.add(&bytes);
            // Where the data lie decides nothing: a folder can be moved.
            let mut experiment = network.experiment.clone();
            experiment.data.files = None;
            decides.add(toml::to_string(&experiment).unwrap_or_default().as_bytes());
        }
        Ok(decides.digest())
    }

    /// Measures, comparisons and tables over all jobs.
    fn put_together(
        &self,
        conditions: Vec<Condition>,
        jobs: Vec<JobResult<S::Findings>>,
        networks: &[Vec<Learned>],
    ) -> Results<S::Findings> {
        let experiments = |own: &Vec<Learned>| own.iter().map(|network| network.experiment.clone()).collect();
        let of = |key: &str| jobs.iter().position(|job| job.condition.unwrap_or("") == key);
        let settings = conditions.iter().filter_map(|one| of(one.key)).map(|at| experiments(&networks[at])).collect();
        let summary: Vec<Summary> = self.study.measures().iter().map(|one| Summary::of(one, &jobs)).collect();
        let clock = |key, label, of: &dyn Fn(&JobResult<S::Findings>) -> f64| {
            let measure = Measure::<S::Findings>::new(key, label, "", "", 1, |_| None);
            Summary::over(&measure, jobs.iter().map(|job| Some(of(job))).collect())
        };
        let trained = |job: &JobResult<S::Findings>| job.trainings.iter().map(|facts| facts.seconds).sum();
        let mut times = vec![
            clock("training", "Training, s", &trained),
            clock("evaluation", "Evaluation, s", &|job| job.seconds_of_evaluation),
        ];
        times.extend(self.study.times().iter().map(|one| Summary::of(one, &jobs)));
        let comparisons = self.study.comparisons().iter().filter_map(|one| one.made(&summary)).collect();
        let tables = Vec::new();
        let mut results = Results { conditions, settings, jobs, summary, times, comparisons, tables };
        results.tables = self.study.tables(&results);
        results
    }
}

/// The network that a training ended with.
fn learned(kind: &Kind, folder: String, experiment: Experiment, training: Training, place: &Path) -> Result<Learned> {
    let network = training.learner.network().clone();
    let name = kind.called(&experiment);
    let facts = TrainingFacts::of(name, &folder, &training);
    Ok(Learned {
        name,
        experiment,
        network,
        initial_states: training.learner.initial_states().clone(),
        scaling: training.scaling,
        source: training.source,
        history: history::read(&place.join(HISTORY))?,
        training: facts,
    })
}
