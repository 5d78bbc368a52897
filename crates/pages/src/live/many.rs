//! Many trainings while they go on, as a page on this machine: learning curves of all, how many are done, and the time left.
//!
//! All of it is read from the run folders, whoever works on them; nothing is asked of a training.

use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use scrnn::learning::EpochReport;
use scrnn_report::{Applet, Block, Page, Section};
use scrnn_run::failure::Result;
use scrnn_run::held_out::Glance;
use scrnn_run::history;
use scrnn_run::messages::Progress;
use scrnn_run::run_folder::{EXPERIMENT, HISTORY};
use serde_json::{Value, json};

use super::server::{Server, served, this_run};

/// Points of a curve, where there are few runs and where there are many.
const POINTS: (usize, usize) = (150, 40);
/// More runs than this are many.
const FEW: usize = 50;
/// Runs whose curves are drawn.
const CURVES: usize = 1_000;
/// Between two looks into the folders.
const BETWEEN_LOOKS: Duration = Duration::from_millis(900);

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stands {
    /// It has its network.
    Finished,
    /// Somebody works on it.
    Working,
    /// It came to nothing.
    Failed,
    /// It was begun, and nobody works on it.
    Interrupted,
    /// It was not begun.
    Waiting,
}

impl Stands {
    /// In a word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Working => "being trained",
            Self::Failed => "failed",
            Self::Interrupted => "interrupted",
            Self::Waiting => "not begun",
        }
    }
}

/// One of many runs.
#[derive(Debug, Clone)]
pub struct OneOfMany {
    /// What it is called.
    pub name: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Where it stands.
    pub stands: Stands,
    /// Why, if there is something to say.
    pub message: String,
}

/// Looks where all runs stand.
pub type LookAtAll = dyn Fn() -> Result<Vec<OneOfMany>> + Send + Sync;

/// A page about many trainings, for as long as this lives.
#[derive(Debug)]
pub struct Many {
    server: Server,
}

impl Many {
    /// Serves a page on the loopback address. A run whose folder does not say it has so many `epochs`.
    ///
    /// # Errors
    /// [`Failure::Input`](scrnn_run::failure::Failure::Input) for a port that is taken.
    pub fn start(port: u16, title: &str, epochs: u64, look: Box<LookAtAll>) -> Result<Self> {
        let page = page(title).live_html();
        let seen = Mutex::new(Seen::new(epochs));
        let answer = move |path: &str| match path {
            "/" => Some(("text/html", page.clone().into_bytes())),
            _ => {
                let since = path.strip_prefix("/data/")?.strip_suffix(".json")?.parse().ok()?;
                let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
                seen.refresh(&*look);
                Some(("application/json", seen.told(since).to_string().into_bytes()))
            }
        };
        Ok(Self { server: served(port, Box::new(answer))? })
    }

    /// Where it is read.
    #[must_use]
    pub fn url(&self) -> String {
        self.server.url()
    }
}

/// Which trainings of this process have ended, by their labels.
#[derive(Debug, Clone, Default)]
pub struct Ends(Arc<Mutex<BTreeSet<String>>>);

impl Ends {
    /// Whether the training of this label has ended.
    #[must_use]
    pub fn contains(&self, label: &str) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).contains(label)
    }

    /// Hears when the training of this label ends.
    #[must_use]
    pub fn watching(&self, label: &str, inner: Box<dyn Progress>) -> Box<dyn Progress> {
        Box::new(Heard { label: label.to_owned(), inner, ends: self.clone() })
    }
}

struct Heard {
    label: String,
    inner: Box<dyn Progress>,
    ends: Ends,
}

impl fmt::Debug for Heard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Heard").field(&self.inner).finish()
    }
}

impl Progress for Heard {
    fn epoch(&mut self, report: &EpochReport) {
        self.inner.epoch(report);
    }

    fn held_out(&mut self, glance: &Glance) {
        self.inner.held_out(glance);
    }

    fn trying(&mut self, what: &str, epoch: u64, epochs: u64) {
        self.inner.trying(what, epoch, epochs);
    }

    fn expect(&mut self, total: u64) {
        self.inner.expect(total);
    }

    fn say(&self, message: &str) {
        self.inner.say(message);
    }

    fn finish(&self) {
        self.ends.0.lock().unwrap_or_else(PoisonError::into_inner).insert(self.label.clone());
        self.inner.finish();
    }
}

/// A curve as it was read, with what tells whether the file has changed.
#[derive(Debug, Default)]
struct Curve {
    file: Option<(u64, SystemTime)>,
    /// Asked for once, when the run's experiment is there.
    epochs: Option<u64>,
    /// Epoch, value, and value on what is held out.
    points: Vec<(u64, f64, Option<f64>)>,
    last: Option<(u64, f64, Option<f64>)>,
    with_variance: bool,
    stands: Option<Stands>,
    message: String,
    /// The version of the page's data in which it changed.
    changed: u64,
}

/// All that was seen.
#[derive(Debug)]
struct Seen {
    run: String,
    epochs: u64,
    looked: Option<Instant>,
    version: u64,
    names: Vec<String>,
    curves: HashMap<String, Curve>,
    /// Epochs that were done when the page was first asked for.
    begun: Option<(Instant, u64)>,
    problem: Option<String>,
}

impl Seen {
    fn new(epochs: u64) -> Self {
        Self {
            run: this_run(),
            epochs,
            looked: None,
            version: 0,
            names: Vec::new(),
            curves: HashMap::new(),
            begun: None,
            problem: None,
        }
    }

    /// Looks again, unless that was just done.
    fn refresh(&mut self, look: &LookAtAll) {
        if self.looked.is_some_and(|looked| looked.elapsed() < BETWEEN_LOOKS) {
            return;
        }
        self.version += 1;
        let all = match look() {
            Ok(all) => all,
            Err(failure) => {
                self.problem = Some(failure.to_string());
                self.looked = Some(Instant::now());
                return;
            }
        };
        self.problem = None;
        let points = if all.len() > FEW { POINTS.1 } else { POINTS.0 };
        for one in &all {
            let curve = self.curves.entry(one.name.clone()).or_default();
            let mut changed = curve.stands != Some(one.stands) || curve.message != one.message;
            (curve.stands, curve.message) = (Some(one.stands), one.message.clone());
            let path = one.folder.join(HISTORY);
            let file = std::fs::metadata(&path).ok().and_then(|found| Some((found.len(), found.modified().ok()?)));
            if file.is_some() && file != curve.file {
                curve.file = file;
                curve.read(&history::read(&path).unwrap_or_default(), points);
                changed = true;
            }
            if curve.epochs.is_none() {
                curve.epochs = epochs_of(&one.folder.join(EXPERIMENT));
            }
            if changed {
                curve.changed = self.version;
            }
        }
        self.names = all.into_iter().map(|one| one.name).collect();
        // A look at thousands of folders takes its time: the next one comes as long after this one.
        self.looked = Some(Instant::now());
        let done = self.done();
        self.begun.get_or_insert((Instant::now(), done));
    }

    fn runs(&self) -> impl Iterator<Item = (&String, &Curve)> {
        self.names.iter().filter_map(|name| Some((name, self.curves.get(name)?)))
    }

    /// Epochs of all runs. Who is finished, or came to nothing, has no more to do.
    fn done(&self) -> u64 {
        self.runs().map(|(_, curve)| curve.done(self.epochs)).sum()
    }

    /// Seconds until all is done, at the speed since the page was first asked for.
    fn left(&self) -> Option<f64> {
        let (at, before) = self.begun?;
        let done = self.done();
        let all: u64 = self.runs().map(|(_, curve)| curve.epochs.unwrap_or(self.epochs)).sum();
        let speed = done.saturating_sub(before) as f64 / at.elapsed().as_secs_f64();
        (speed > 0.0).then(|| all.saturating_sub(done) as f64 / speed)
    }

    /// What changed since a version.
    fn told(&self, since: u64) -> Value {
        let since = if since > self.version { 0 } else { since };
        let counts = [Stands::Finished, Stands::Working, Stands::Failed, Stands::Interrupted, Stands::Waiting];
        let counts = counts.map(|stands| {
            let count = self.runs().filter(|(_, curve)| curve.stands == Some(stands)).count();
            json!([stands.word(), count])
        });
        let changed = self.runs().enumerate().filter(|(_, (_, curve))| curve.changed > since);
        let changed = changed.map(|(k, (name, curve))| curve.json(k, name, self.epochs, k < CURVES));
        json!({
            "run": self.run, "version": self.version, "runs": self.names.len(), "counts": counts, "left": self.left(),
            "finished": self.runs().all(|(_, curve)| matches!(curve.stands, Some(Stands::Finished | Stands::Failed))) && !self.names.is_empty(),
            "problem": self.problem, "with_variance": self.runs().any(|(_, curve)| curve.with_variance),
            "changed": changed.collect::<Vec<_>>(),
        })
    }
}

impl Curve {
    fn read(&mut self, rows: &[history::Row], points: usize) {
        self.with_variance = rows.last().is_some_and(|row| row.nll.is_some());
        let shown = |row: &history::Row| {
            let held_out = row.held_out.map(|value| if row.nll.is_some() { value } else { value.log10() });
            (row.epoch, row.nll.unwrap_or_else(|| row.mse.log10()), held_out)
        };
        self.last = rows.last().map(shown);
        let every = rows.len().div_ceil(points).max(1);
        self.points = rows.iter().step_by(every).map(shown).collect();
        if self.points.last() != self.last.as_ref() {
            self.points.extend(self.last);
        }
    }

    fn done(&self, usual: u64) -> u64 {
        let all = self.epochs.unwrap_or(usual);
        match self.stands {
            Some(Stands::Finished | Stands::Failed) => all,
            _ => self.last.map_or(0, |(epoch, _, _)| epoch).min(all),
        }
    }

    fn json(&self, k: usize, name: &str, usual: u64, drawn: bool) -> Value {
        let points = if drawn { self.points.as_slice() } else { &[] };
        let known = |value: f64| json!(format!("{value:.5e}").parse::<f64>().ok().filter(|value| value.is_finite()));
        let held_out = |point: &(u64, f64, Option<f64>)| Some(json!([point.0, known(point.2?)]));
        json!({
            "k": k, "name": name, "state": self.stands.map(Stands::word), "message": self.message,
            "epoch": self.last.map_or(0, |last| last.0), "epochs": self.epochs.unwrap_or(usual),
            "value": self.last.map(|last| known(last.1)),
            "curve": points.iter().map(|point| json!([point.0, known(point.1)])).collect::<Vec<_>>(),
            "held_out": points.iter().filter_map(held_out).collect::<Vec<_>>(),
        })
    }
}

/// The number of epochs in the experiment file of a run.
fn epochs_of(path: &std::path::Path) -> Option<u64> {
    let text = std::fs::read_to_string(path).ok()?;
    let table: toml::Table = text.parse().ok()?;
    u64::try_from(table.get("training")?.get("epochs")?.as_integer()?).ok()
}

const BODY: &str = r#"<p class="verdict stand" role="status" aria-live="polite">Waiting for the first run.</p>
<svg class="curves" viewBox="0 0 720 340" role="img" aria-label="Learning curves of all runs"></svg>
<p class="key"></p>
<div class="sheet" role="region" aria-label="Runs" tabindex="0"><table><caption>Runs</caption>
<thead><tr><th scope="col">run</th><th scope="col">state</th><th scope="col" class="n">epoch</th><th scope="col" class="n">value</th><th scope="col"></th></tr></thead>
<tbody class="runs"></tbody></table></div>
<p class="note more"></p>"#;

fn page(title: &str) -> Page {
    let applet = Applet {
        name: "many".into(),
        title: "All trainings".into(),
        caption: "Lower is better. A curve grows whenever its run saves; point at one, or at a row, to see which is which. The page asks \
                  once a second, and only this machine; it reads the run folders, whoever works on them."
            .into(),
        body: BODY.into(),
        style: include_str!("many.css"),
        script: concat!(include_str!("../common.js"), include_str!("many.js")),
        data: "{}".into(),
    };
    let blocks = vec![Block::Applet(Box::new(applet))];
    let sections = vec![Section { title: "Learning".into(), blocks }];
    Page { title: title.to_owned(), lede: "As it goes on, on this machine.".into(), sections }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;

    #[test]
    fn curves_are_read_when_they_grow_and_told_to_whoever_has_not_seen_them() {
        let place = std::env::temp_dir().join(format!("scrnn-many-{}", std::process::id()));
        let folders: Vec<PathBuf> = (0..3).map(|k| place.join(k.to_string())).collect();
        let write = |k: usize, rows: u64| {
            let mut text = "epoch,nll,mse,rate_shared,rate_initial,gradient_norm,seconds,recoveries\n".to_owned();
            (0..rows).for_each(|epoch| writeln!(text, "{epoch},{},0.1,1,1,1,1,0", 1.0 / (epoch + 1) as f64).unwrap());
            std::fs::create_dir_all(&folders[k]).unwrap();
            std::fs::write(folders[k].join(HISTORY), text).unwrap();
        };
        write(0, 1000);
        std::fs::write(folders[0].join(EXPERIMENT), "[training]\nepochs = 1000\n").unwrap();
        write(1, 10);
        let stands = [Stands::Finished, Stands::Working, Stands::Waiting];
        let look = {
            let folders = folders.clone();
            move || {
                let one = |k: usize| OneOfMany {
                    name: k.to_string(),
                    folder: folders[k].clone(),
                    stands: stands[k],
                    message: String::new(),
                };
                Ok((0..3).map(one).collect::<Vec<_>>())
            }
        };
        let mut seen = Seen::new(500);
        seen.refresh(&look);
        let told = seen.told(0);
        assert_eq!(told["changed"].as_array().unwrap().len(), 3, "{told}");
        let first = &told["changed"][0];
        assert!(first["curve"].as_array().unwrap().len() <= POINTS.0 + 1 && first["epochs"] == 1000, "{first}");
        assert_eq!(first["curve"].as_array().unwrap().last().unwrap()[0], 999);
        assert_eq!((&told["counts"][0], &told["counts"][1]), (&json!(["finished", 1]), &json!(["being trained", 1])));
        assert_eq!((seen.done(), told["finished"].as_bool()), (1000 + 9, Some(false)));
        write(1, 20);
        seen.looked = None;
        seen.refresh(&look);
        let told = seen.told(told["version"].as_u64().unwrap());
        let changed = told["changed"].as_array().unwrap();
        assert!(changed.len() == 1 && changed[0]["epoch"] == 19, "{told}");
        assert!(told["left"].as_f64().unwrap() > 0.0);
        std::fs::remove_dir_all(place).unwrap();
    }
}
