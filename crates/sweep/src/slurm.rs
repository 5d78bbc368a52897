//! A sweep as an array job of SLURM: each task works on one shard.
//!
//! Two minutes before the time limit SLURM sends SIGUSR1: the task ends its epoch, saves, and puts itself back into the queue. Pre-emption
//! sends SIGTERM: it saves too, and SLURM puts it back. A task that is killed without a word loses what came after its last checkpoint.

use std::path::{Path, PathBuf};
use std::process::Command;

use scrnn_run::failure::{Failure, Result};

/// The folder of script and logs, in that of the sweep.
pub const FOLDER: &str = "slurm";
/// The script's name.
const SCRIPT: &str = "job.sh";
/// Most tasks of an array that is not asked for: clusters have their own bounds.
const USUAL_TASKS: usize = 64;

/// What is asked of the cluster.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// The partition; the cluster's own where it is not said.
    pub partition: Option<String>,
    /// The time limit of a task, as SLURM writes it; the cluster's own where it is not said.
    pub time: Option<String>,
    /// Tasks of the array; one for each run, 64 at most, where it is not said.
    pub tasks: Option<usize>,
    /// Cores of a task, on which its networks learn side by side.
    pub cores: usize,
}

/// What a task calls.
#[derive(Debug, Clone)]
pub struct Called<'a> {
    /// The program.
    pub program: &'a Path,
    /// The sweep file.
    pub sweep: &'a Path,
    /// The sweep's name.
    pub name: &'a str,
    /// The folder of the sweep.
    pub folder: &'a Path,
}

/// Text as a word of the shell.
fn word(text: &str) -> String {
    format!("'{}'", text.replace('\'', "'\\''"))
}

impl Request {
    /// How many tasks there are for so many runs.
    #[must_use]
    pub fn tasks_for(&self, runs: usize) -> usize {
        self.tasks.unwrap_or(USUAL_TASKS).min(runs).max(1)
    }

    /// Whether words that go into the script's head are such that SLURM can take them.
    ///
    /// # Errors
    /// [`Failure::Input`].
    pub fn check(&self) -> Result<()> {
        let sound = |text: &Option<String>, more: &str| {
            text.as_ref().is_none_or(|text| {
                !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || more.contains(c))
            })
        };
        if !sound(&self.time, ":-") {
            let message = format!("the time limit is {:?}", self.time.as_deref().unwrap_or_default());
            return Err(Failure::input(message, "write it as SLURM does: 30 (minutes), 12:00:00 or 2-00:00:00 (days)"));
        }
        if !sound(&self.partition, "-_.,") {
            let message = format!("the partition is {:?}", self.partition.as_deref().unwrap_or_default());
            return Err(Failure::input(message, "`sinfo` lists the cluster's partitions"));
        }
        Ok(())
    }

    /// The script of the array job.
    #[must_use]
    pub fn script(&self, runs: usize, called: &Called<'_>) -> String {
        let tasks = self.tasks_for(runs);
        let name: String =
            called.name.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect();
        let mut head = format!(
            "#SBATCH --job-name={name}\n#SBATCH --array=1-{tasks}\n#SBATCH --cpus-per-task={}\n#SBATCH --requeue\n\
             #SBATCH --open-mode=append\n#SBATCH --signal=B:USR1@120\n",
            self.cores
        );
        if let Some(partition) = &self.partition {
            head += &format!("#SBATCH --partition={partition}\n");
        }
        if let Some(time) = &self.time {
            head += &format!("#SBATCH --time={time}\n");
        }
        let path = |path: &Path| word(&path.display().to_string());
        format!(
            "#!/bin/sh\n{head}\
             # Written by `scrnn sweep --slurm`. A task works on its shard of the sweep; one that comes again goes on.\n\
             {program} sweep {sweep} --out {folder} --shard \"$SLURM_ARRAY_TASK_ID/{tasks}\" --threads {cores} &\n\
             work=$!\n\
             # SLURM sends SIGTERM to all processes of a task, SIGUSR1 to this one alone.\n\
             trap : TERM\n\
             trap 'kill -USR1 \"$work\" 2>/dev/null' USR1\n\
             # A signal ends the waiting, not the work.\n\
             wait \"$work\"\n\
             code=$?\n\
             while kill -0 \"$work\" 2>/dev/null; do\n    wait \"$work\"\n    code=$?\ndone\n\
             # The time is over, and the network is saved: back into the queue.\n\
             if [ \"$code\" = 138 ]; then\n    scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID\"\nfi\n\
             exit \"$code\"\n",
            program = path(called.program),
            sweep = path(called.sweep),
            folder = path(called.folder),
            cores = self.cores,
        )
    }

    /// Writes the script into the folder of the sweep.
    ///
    /// # Errors
    /// [`Failure::Disk`].
    pub fn write(&self, runs: usize, called: &Called<'_>) -> Result<PathBuf> {
        self.check()?;
        let folder = called.folder.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(|error| Failure::disk("make the folder", &folder, error))?;
        let path = folder.join(SCRIPT);
        scrnn_data::replace(&path, self.script(runs, called).as_bytes())?;
        Ok(path)
    }
}

/// Hands the script to `sbatch`; what that says.
///
/// # Errors
/// [`Failure::Refused`] if there is no `sbatch`, or it refuses.
pub fn submit(script: &Path) -> Result<String> {
    let mut logs = script.parent().unwrap_or(Path::new("")).as_os_str().to_owned();
    logs.push("/task-%a.log");
    let mut output = std::ffi::OsString::from("--output=");
    output.push(logs);
    let help = format!("call it where the cluster's jobs are submitted; the script is {}", script.display());
    let answer = Command::new("sbatch").arg(output).arg(script).output();
    let answer =
        answer.map_err(|error| Failure::refused(format!("`sbatch` cannot be called: {error}"), help.clone()))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    match answer.status.success() {
        true => Ok(text(&answer.stdout)),
        false => Err(Failure::refused(format!("`sbatch` refused the job: {}", text(&answer.stderr)), help)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn script(request: &Request) -> String {
        let called = Called {
            program: Path::new("/opt/my tools/scrnn"),
            sweep: Path::new("/home/it's/s.toml"),
            name: "seven variances",
            folder: Path::new("/data/runs/s"),
        };
        request.script(10, &called)
    }

    #[test]
    fn a_script_asks_for_what_is_wanted_and_takes_any_path() {
        let text = script(&Request {
            partition: Some("short".into()),
            time: Some("12:00:00".into()),
            tasks: Some(4),
            cores: 2,
        });
        for line in [
            "#SBATCH --job-name=seven_variances\n",
            "#SBATCH --array=1-4\n",
            "#SBATCH --cpus-per-task=2\n",
            "#SBATCH --partition=short\n",
            "#SBATCH --time=12:00:00\n",
            "#SBATCH --requeue\n",
            "'/opt/my tools/scrnn' sweep '/home/it'\\''s/s.toml' --out '/data/runs/s' --shard \"$SLURM_ARRAY_TASK_ID/4\" --threads 2 &\n",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
        assert!(script(&Request { cores: 1, ..Request::default() }).contains("--array=1-10\n"));
    }

    #[test]
    fn words_that_would_break_the_script_are_refused() {
        for time in ["", "1 hour", "1\n#SBATCH --x", "$(x)"] {
            assert!(Request { time: Some(time.into()), ..Request::default() }.check().is_err(), "{time}");
        }
        assert!(Request { partition: Some("a b".into()), ..Request::default() }.check().is_err());
        assert!(
            Request { time: Some("2-00:00:00".into()), partition: Some("gpu-a.1".into()), ..Request::default() }
                .check()
                .is_ok()
        );
    }

    #[cfg(unix)]
    #[test]
    fn the_shell_understands_the_script() {
        let text = script(&Request { cores: 1, ..Request::default() });
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        assert!(Command::new("sh").arg("-n").arg(file.path()).status().unwrap().success());
    }
}
