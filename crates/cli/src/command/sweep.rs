//! `scrnn sweep`: many networks from one file.

use std::path::{Path, PathBuf};

use clap::Args;
use scrnn_run::failure::{Ending, Failure, Result};
use scrnn_sweep::plan::{PLAN, Plan};
use scrnn_sweep::slurm::{self, Called, Request};
use scrnn_sweep::status::{self, Named, State, Status};
use scrnn_sweep::working::{self, Context, Options, Worked};
use serde_json::json;

use crate::args::{Shared, count, number};
use crate::output;
use crate::progress::Bars;
use crate::signals::Signals;
use scrnn_pages::live::{Many, OneOfMany, Stands};

/// Train many networks: knobs times seeds, side by side, on one machine or on many
///
/// The sweep file names an experiment, the keys that vary ([grid], [random], [[conditions]]), the seeds, and what is done with each trained
/// network ([then]). Each network gets a run folder whose name says what differs. Finished runs are not repeated, interrupted and killed
/// ones go on to the same bits, and one that diverges does not end the others. Any number of processes, on any number of machines with
/// one file system, may work on one sweep at a time: call the same command again. `scrnn compare` then makes one page of all of them.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  scrnn sweep variances.toml --dry-run          what would be trained
  scrnn sweep variances.toml                    into runs/variances, on all cores
  scrnn sweep variances.toml --status           how far it is; also of the folder alone
  scrnn sweep variances.toml --watch            with a page that shows all of it
  scrnn sweep variances.toml --shard 2/4        the second quarter of the runs
  scrnn sweep variances.toml --slurm --time 12:00:00 --array-size 20
  scrnn compare runs/variances                  one page and metrics.csv")]
pub struct Arguments {
    /// The sweep file; with --status also the sweep's folder
    sweep: PathBuf,
    /// The folder of the sweep [default: runs/NAME, after the sweep's name]
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Work on every N-th run only, from the I-th on
    #[arg(long, value_name = "I/N", value_parser = shard, default_value = "1/1", hide_default_value = true)]
    shard: (usize, usize),
    /// Show what would be trained, and train nothing
    #[arg(long)]
    dry_run: bool,
    /// Show how far the sweep is
    #[arg(long, conflicts_with_all = ["dry_run", "slurm"])]
    status: bool,
    /// Train runs anew that diverged, or that killed whoever worked on them
    #[arg(long)]
    retry: bool,
    /// End when all runs are finished or being trained by others, instead of waiting to take over what is lost
    #[arg(long)]
    no_wait: bool,
    /// Seconds, 1 to 86400, after which a run is taken over from another machine that gave no sign of life
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0, value_parser = number(1.0, 86400.0))]
    stale: f64,
    /// Write an array job for SLURM and submit it with sbatch; each task works on a shard, on --threads cores [default: 1]
    #[arg(long)]
    slurm: bool,
    /// With --slurm: the partition [default: the cluster's]
    #[arg(long, value_name = "NAME", requires = "slurm")]
    partition: Option<String>,
    /// With --slurm: the time limit of a task, e.g. 12:00:00; what is not finished then is saved and queued again
    #[arg(long, value_name = "TIME", requires = "slurm")]
    time: Option<String>,
    /// With --slurm: tasks of the array, 1 to 100000 [default: one for each run, 64 at most]
    #[arg(long, value_name = "N", requires = "slurm", value_parser = count(1, 100_000))]
    array_size: Option<usize>,
    /// Serve a page on this machine that shows all runs as they go on, at this port or any that is free; with --status whoever works on
    /// them, until Ctrl-C
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true,
        conflicts_with_all = ["dry_run", "slurm"])]
    watch: Option<u16>,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

/// `I/N`.
fn shard(text: &str) -> std::result::Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    parts.filter(|&(i, n)| i >= 1 && i <= n).ok_or_else(|| "give it as 2/4: the second of four".to_owned())
}

/// Works on a sweep, or shows it.
pub fn run(arguments: &Arguments, (shared, signals): (&Shared, &Signals)) -> Result<Ending> {
    if arguments.status && arguments.sweep.join(PLAN).is_file() {
        return show_status(&arguments.sweep, None, arguments, signals);
    }
    if arguments.sweep.is_dir() {
        let message = format!("{} is a folder, not a sweep file", arguments.sweep.display());
        return Err(Failure::input(
            message,
            "give the sweep file; --status takes a sweep's folder, and `scrnn compare` makes its page",
        ));
    }
    let plan = Plan::read(&arguments.sweep)?;
    let folder = arguments.out.clone().unwrap_or_else(|| Path::new("runs").join(&plan.file.name));
    if arguments.status {
        return show_status(&folder, Some(&plan), arguments, signals);
    }
    if arguments.slurm {
        return queue(arguments, (shared, &plan), &folder);
    }
    if arguments.dry_run {
        return show(&plan, &folder, arguments.json);
    }
    let interrupt = signals.listen();
    let bars = Bars::passing(shared.quiet);
    let context = Context {
        threads: shared.engine()?.threads(),
        instruction_set: shared.instruction_set(),
        interrupt: &interrupt,
        messages: shared,
        progress: &|label, epochs| bars.bar(label, epochs),
    };
    let options = Options {
        shard: arguments.shard,
        patience: std::time::Duration::from_secs_f64(arguments.stale),
        retry: arguments.retry,
        wait: !arguments.no_wait,
    };
    if arguments.watch.is_some() {
        // Whoever is told of the page may look into the folder, too.
        working::prepare(&plan, &folder, shared)?;
    }
    let _page = page(arguments.watch, &folder, Some(&plan))?;
    let worked = working::work(&plan, &folder, &options, &context)?;
    if arguments.json {
        output::print_json(&worked)?;
    } else {
        output::print(&format!("{worked}{}\n", folder.display()))?;
    }
    Ok(ending(&worked, arguments, shared))
}

/// What is to be said of an early end, and its exit code.
fn ending(worked: &Worked, arguments: &Arguments, shared: &Shared) -> Ending {
    if worked.interrupted {
        let out = arguments.out.as_ref().map_or(String::new(), |out| format!(" --out {}", out.display()));
        shared.say(format_args!(
            "interrupted; all networks are saved. To go on:\n  scrnn sweep {}{out}",
            arguments.sweep.display()
        ));
    }
    worked.ending()
}

/// Serves a page about the runs in the folder of a sweep, if that is wanted. Runs that were not begun have as many epochs as the plan's
/// first, if there is a plan at hand.
fn page(watch: Option<u16>, folder: &Path, plan: Option<&Plan>) -> Result<Option<Many>> {
    let Some(port) = watch else { return Ok(None) };
    let name = folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into_owned();
    let epochs = plan.and_then(|plan| Some(plan.experiment(plan.runs.first()?).ok()?.training.epochs)).unwrap_or(0);
    let folder = folder.to_owned();
    let look = move || {
        let one = |Named { run, state, message }: Named| OneOfMany {
            folder: folder.join(&run),
            name: run,
            stands: match state {
                State::Finished => Stands::Finished,
                State::Working => Stands::Working,
                State::Diverged | State::Killed | State::Failed => Stands::Failed,
                State::Interrupted => Stands::Interrupted,
                State::Waiting => Stands::Waiting,
            },
            message,
        };
        Ok(status::each(&folder)?.into_iter().map(one).collect())
    };
    let page = Many::start(port, &format!("Sweep: {name}"), epochs, Box::new(look))?;
    output::say(format_args!("watch it at {}", page.url()));
    Ok(Some(page))
}

fn show_status(folder: &Path, plan: Option<&Plan>, arguments: &Arguments, signals: &Signals) -> Result<Ending> {
    let status = Status::read(folder)?;
    if let Some(_page) = page(arguments.watch, folder, plan)? {
        let interrupt = signals.listen();
        while !interrupt.asked() {
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
    }
    match arguments.json {
        true => output::print_json(&status)?,
        false => output::print(&status.to_string())?,
    }
    Ok(Ending::Done)
}

/// All settings, a line each.
fn show(plan: &Plan, folder: &Path, json: bool) -> Result<Ending> {
    if json {
        output::print_json(&plan.listed())?;
        return Ok(Ending::Done);
    }
    let mut text = String::new();
    let mut seeds = vec![0_usize; plan.settings.len()];
    plan.runs.iter().for_each(|run| seeds[run.setting] += 1);
    for (setting, seeds) in plan.settings.iter().zip(seeds) {
        let name = if setting.name.is_empty() { "(the experiment as it is)" } else { &setting.name };
        text += &format!("{name}  x {seeds}\n");
    }
    let (runs, settings) = (plan.runs.len(), plan.settings.len());
    text += &format!("{runs} networks of {settings} settings, into {}\n", folder.display());
    output::print(&text)?;
    Ok(Ending::Done)
}

/// Writes the array job, and submits it unless it is only to be looked at.
fn queue(arguments: &Arguments, (shared, plan): (&Shared, &Plan), folder: &Path) -> Result<Ending> {
    let absolute = |path: &Path| std::path::absolute(path).map_err(|error| Failure::disk("find", path, error));
    let program = std::env::current_exe().map_err(|error| Failure::disk("find", Path::new("scrnn"), error))?;
    let (sweep, folder) = (absolute(&arguments.sweep)?, absolute(folder)?);
    let request = Request {
        partition: arguments.partition.clone(),
        time: arguments.time.clone(),
        tasks: arguments.array_size,
        cores: shared.threads.max(1),
    };
    request.check()?;
    working::prepare(plan, &folder, shared)?;
    let called = Called { program: &program, sweep: &sweep, name: &plan.file.name, folder: &folder };
    let script = request.write(plan.runs.len(), &called)?;
    let tasks = request.tasks_for(plan.runs.len());
    let answer = if arguments.dry_run { String::new() } else { slurm::submit(&script)? };
    if arguments.json {
        output::print_json(&json!({ "script": script.display().to_string(), "tasks": tasks, "sbatch": answer }))?;
    } else {
        let answer = if answer.is_empty() { "not submitted".to_owned() } else { answer };
        output::print(&format!("{answer}: {tasks} tasks, {}\n", script.display()))?;
    }
    Ok(Ending::Done)
}
