//! A sweep as an array job: by a real SLURM of one machine with two nodes where it can be started, and by a stand-in for `sbatch` always.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::{Place, SINE, same_files, wait_for};

/// A stand-in for `sbatch`: runs all tasks of the array one after the other, and one of them again after it was told to end.
const SBATCH: &str = r#"#!/bin/sh
for script; do :; done
tasks=$(sed -n 's/^#SBATCH --array=1-//p' "$script")
export SLURM_ARRAY_JOB_ID=7
for SLURM_ARRAY_TASK_ID in $(seq "$tasks"); do
    export SLURM_ARRAY_TASK_ID
    if [ "$SLURM_ARRAY_TASK_ID" = 2 ]; then
        timeout --signal=TERM 0.3 sh "$script" >/dev/null 2>&1
    fi
    sh "$script" >/dev/null 2>&1 || exit 1
done
echo "Submitted batch job 7"
"#;

const SWEEP: &str = "seeds = 4\n[grid]\n\"training.adam.rate\" = [1e-3, 1e-2]\n[then]\nreport = false\n";

#[test]
fn an_array_job_works_on_shards_and_comes_to_the_same_bytes() {
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 300"), SWEEP);
    place.ends(0, "sweep s.toml --out whole --quiet");
    fs::create_dir(place.path("bin")).unwrap();
    fs::write(place.path("bin/sbatch"), SBATCH).unwrap();
    fs::set_permissions(place.path("bin/sbatch"), fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", place.path("bin").display(), std::env::var("PATH").unwrap());
    let output = place
        .command("sweep s.toml --out array --slurm --time 1:00:00 --array-size 3 --json")
        .env("PATH", path)
        .output()
        .unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(0), "{out}{err}");
    let told: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((told["tasks"].as_u64(), told["sbatch"].as_str()), (Some(3), Some("Submitted batch job 7")), "{told}");
    fs::remove_dir_all(place.path("array/slurm")).unwrap();
    same_files(&place, "whole", "array");
}

#[test]
fn a_machine_without_slurm_is_told_of_and_the_script_stays() {
    let place = Place::new(SINE, SWEEP);
    fs::create_dir(place.path("bin")).unwrap();
    let output = place.command("sweep s.toml --slurm").env("PATH", place.path("bin")).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(5), "{err}");
    assert!(err.contains("`sbatch` cannot be called") && place.path("runs/s/slurm/job.sh").exists(), "{err}");
    let out = place.ends(0, "sweep s.toml --slurm --dry-run").0;
    assert!(out.starts_with("not submitted: 8 tasks, "), "{out}");
    let err = place.ends(2, "sweep s.toml --partition short").1;
    assert!(err.contains("--slurm"), "{err}");
}

/// A SLURM of this machine, with two nodes; its daemons end with it.
struct Slurm {
    folder: tempfile::TempDir,
    daemons: Vec<Child>,
}

impl Drop for Slurm {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

fn found(program: &str) -> Option<PathBuf> {
    ["/usr/sbin", "/usr/bin", "/usr/local/sbin", "/usr/local/bin"]
        .map(|folder| PathBuf::from(folder).join(program))
        .into_iter()
        .find(|path| path.exists())
}

impl Slurm {
    /// None, with the reason, where it cannot be started.
    fn start() -> Result<Self, String> {
        let need = |program: &str| found(program).ok_or(format!("there is no {program}"));
        let (munged, slurmctld, slurmd) = (need("munged")?, need("slurmctld")?, need("slurmd")?);
        need("sbatch")?;
        let is_root = Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout == b"0\n");
        if !is_root {
            return Err("its daemons need root".to_owned());
        }
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let at = |name: &str| folder.path().join(name);
        for name in ["state", "spool-n1", "spool-n2"] {
            fs::create_dir(at(name)).map_err(|error| error.to_string())?;
        }
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).map_err(|error| error.to_string())?;
        // A key of 1024 bytes, and a socket where nobody else's is.
        fs::write(at("munge.key"), [b'k'; 1024]).map_err(|error| error.to_string())?;
        fs::set_permissions(at("munge.key"), fs::Permissions::from_mode(0o600)).map_err(|error| error.to_string())?;
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().to_owned();
        let base = 20_000 + (std::process::id() % 20_000) as u16;
        let shown = |name: &str| at(name).display().to_string();
        let conf = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={base}\nSlurmUser=root\nAuthType=auth/munge\nAuthInfo=socket={}\n\
             CredType=cred/munge\nStateSaveLocation={}\nSlurmdSpoolDir={}%n\nSlurmctldPidFile={}\nSlurmdPidFile={}%n.pid\nSlurmctldLogFile={}\n\
             SlurmdLogFile={}%n.log\nProctrackType=proctrack/pgid\nTaskPlugin=task/none\nSelectType=select/cons_tres\n\
             SelectTypeParameters=CR_Core\nReturnToService=2\nMpiDefault=none\nSwitchType=switch/none\nJobRequeue=1\nKillWait=5\n\
             SchedulerParameters=sched_interval=1,batch_sched_delay=0,requeue_setup_env_fail\nSlurmdParameters=config_overrides\n\
             NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={} CPUs=1 RealMemory=500\n\
             NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={} CPUs=1 RealMemory=500\n\
             PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP\n",
            shown("munge.socket"),
            shown("state"),
            shown("spool-"),
            shown("ctld.pid"),
            shown("slurmd"),
            shown("ctld.log"),
            shown("slurmd"),
            base + 1,
            base + 2,
        );
        fs::write(at("slurm.conf"), conf).map_err(|error| error.to_string())?;
        let mut slurm = Self { daemons: Vec::new(), folder };
        let at = |name: &str| slurm.folder.path().join(name);
        let mut daemons = vec![Command::new(munged)];
        daemons[0].args(["--foreground", "--force"]);
        for (option, name) in [
            ("socket", "munge.socket"),
            ("key-file", "munge.key"),
            ("pid-file", "munge.pid"),
            ("log-file", "munge.log"),
            ("seed-file", "munge.seed"),
        ] {
            daemons[0].arg(format!("--{option}={}", at(name).display()));
        }
        let mut control = Command::new(slurmctld);
        control.args(["-D", "-i", "-f"]).arg(at("slurm.conf"));
        daemons.push(control);
        for node in ["n1", "n2"] {
            let mut daemon = Command::new(&slurmd);
            daemon.args(["-D", "-N", node, "-f"]).arg(at("slurm.conf"));
            daemons.push(daemon);
        }
        for mut daemon in daemons {
            daemon
                .env("SLURM_CONF", slurm.folder.path().join("slurm.conf"))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .stdin(Stdio::null());
            slurm.daemons.push(daemon.spawn().map_err(|error| error.to_string())?);
            std::thread::sleep(Duration::from_millis(700));
        }
        let begun = std::time::Instant::now();
        while slurm.call("sinfo", &["-h", "-o", "%T"]).trim() != "idle" {
            if begun.elapsed() > Duration::from_secs(30) {
                let read = |name: &str| fs::read_to_string(slurm.folder.path().join(name)).unwrap_or_default();
                let log = ["ctld.log", "slurmdn1.log", "munge.log"].map(read).join("\n");
                let end: Vec<&str> = log.lines().rev().take(12).collect();
                return Err(format!("its nodes do not come up:\n{}", end.join("\n")));
            }
            std::thread::sleep(Duration::from_millis(200));
        }
        Ok(slurm)
    }

    fn call(&self, program: &str, arguments: &[&str]) -> String {
        let output =
            Command::new(program).args(arguments).env("SLURM_CONF", self.folder.path().join("slurm.conf")).output();
        output.map_or(String::new(), |output| String::from_utf8_lossy(&output.stdout).into_owned())
    }
}

#[test]
fn an_array_of_eight_tasks_of_a_real_slurm_with_one_pre_empted_comes_to_the_same_bytes() {
    let slurm = match Slurm::start() {
        Ok(slurm) => slurm,
        Err(reason) => {
            eprintln!(
                "SKIPPED: no SLURM can be started here ({reason}); the stand-in for sbatch was tried in its place"
            );
            return;
        }
    };
    let place = Place::new(&SINE.replace("epochs = 1500", "epochs = 6000"), SWEEP);
    fs::set_permissions(place.0.path(), fs::Permissions::from_mode(0o755)).unwrap();
    place.ends(0, "sweep s.toml --out whole --quiet");
    let conf = slurm.folder.path().join("slurm.conf");
    let output = place
        .command("sweep s.toml --out array --slurm --partition all --time 10 --array-size 8 --json")
        .env("SLURM_CONF", &conf)
        .output()
        .unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(output.status.code(), Some(0), "{out}{err}");
    let told: serde_json::Value = serde_json::from_str(&out).unwrap();
    let job = told["sbatch"].as_str().unwrap().rsplit(' ').next().unwrap().to_owned();
    // The first task is sent back into the queue while it trains.
    wait_for("the first network", || place.path("array/rate=1e-3/seed-1/checkpoint.safetensors").exists());
    let answer = slurm.call("scontrol", &["requeue", &format!("{job}_1")]);
    assert!(answer.is_empty(), "{answer}");
    let begun = std::time::Instant::now();
    loop {
        let queue = slurm.call("squeue", &["-h", "-r", "-o", "%i %T %r"]);
        if queue.trim().is_empty() {
            break;
        }
        // Who was sent back waits two minutes, unless somebody lets it go.
        slurm.call("scontrol", &["update", &format!("JobId={job}_1"), "StartTime=now"]);
        assert!(begun.elapsed() < Duration::from_secs(300), "{queue}");
        std::thread::sleep(Duration::from_millis(300));
    }
    let status = place.json("sweep array --status --json");
    assert_eq!(status["finished"].as_u64(), Some(8), "{status}");
    let restarts = fs::read_to_string(place.path("array/slurm/task-1.log")).unwrap_or_default();
    fs::remove_dir_all(place.path("array/slurm")).unwrap();
    same_files(&place, "whole", "array");
    assert!(!restarts.is_empty(), "the task says what it did");
}
