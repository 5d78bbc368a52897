//! Threads, instruction sets and the signals of a person who wants to stop.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use scrnn::engine::{Engine, InstructionSet};
use scrnn::learning::EpochReport;
use scrnn_run::failure::{Failure, Result};
use scrnn_run::held_out::Glance;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::{Messages, Progress};

use crate::failure::{compute, in_python, raise, raise_panic};

/// Between two looks for signals.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);
/// Between two updates of a bar.
const BETWEEN_UPDATES: Duration = Duration::from_millis(100);
/// As much as a program's first thread has.
const STACK: usize = 8 << 20;

/// Engines that are kept, by process, threads and instruction set: a child of this process has none of its threads.
type Engines = HashMap<(u32, usize, String), Engine>;
static ENGINES: LazyLock<Mutex<Engines>> = LazyLock::new(Mutex::default);

/// So many threads (0 for one each core) and these vector instructions, by default the best there are.
pub fn engine(threads: usize, instruction_set: Option<&str>) -> Result<Engine> {
    let set = match instruction_set {
        None => InstructionSet::best(),
        Some(name) => name.parse()?,
    };
    let key = (std::process::id(), threads, set.to_string());
    let mut engines = locked(&ENGINES);
    if let Some(engine) = engines.get(&key) {
        return Ok(engine.clone());
    }
    let engine = Engine::new(threads, set)?;
    engines.insert(key, engine.clone());
    Ok(engine)
}

/// What is told while work goes on. It is kept until the thread that called has time for it: Python's own things (warnings, notebooks)
/// belong to that thread.
#[derive(Debug, Default)]
pub struct News {
    show: Option<Py<PyAny>>,
    say: Option<Py<PyAny>>,
    kept: Arc<Kept>,
}

/// What waits to be told.
#[derive(Debug, Default)]
struct Kept {
    epochs: Mutex<Vec<Epoch>>,
    said: Mutex<Vec<String>>,
}

/// Where a training stands.
#[derive(Debug, Clone)]
struct Epoch {
    label: String,
    epoch: u64,
    total: u64,
    nll: Option<f64>,
    mse: f64,
    held_out: Option<f64>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl News {
    /// For these functions of Python: `show` gets epochs, `say` sentences.
    pub fn new(show: Option<Py<PyAny>>, say: Option<Py<PyAny>>) -> Self {
        Self { show, say, ..Self::default() }
    }

    /// Hands on what there is. Whether that asked to stop; what it raised.
    pub fn deliver(&self, py: Python<'_>) -> PyResult<bool> {
        for message in std::mem::take(&mut *locked(&self.kept.said)) {
            if let Some(say) = &self.say {
                say.call1(py, (in_python(&message),))?;
            }
        }
        let mut stop = false;
        for Epoch { label, epoch, total, nll, mse, held_out } in std::mem::take(&mut *locked(&self.kept.epochs)) {
            if let Some(show) = &self.show {
                stop |= show.call1(py, (label, epoch, total, nll, mse, held_out))?.is_truthy(py)?;
            }
        }
        Ok(stop)
    }

    /// A training of `total` epochs that is shown.
    pub fn training(&self, label: &str, total: u64) -> Box<dyn Progress> {
        Box::new(Shown { label: label.to_owned(), total, held_out: None, kept: Arc::clone(&self.kept) })
    }
}

impl Messages for News {
    fn say(&self, message: &str) {
        locked(&self.kept.said).push(message.to_owned());
    }
}

/// The epochs of one training.
#[derive(Debug)]
struct Shown {
    label: String,
    total: u64,
    held_out: Option<f64>,
    kept: Arc<Kept>,
}

impl Progress for Shown {
    fn expect(&mut self, total: u64) {
        self.total = total;
    }

    fn epoch(&mut self, report: &EpochReport) {
        let mut epochs = locked(&self.kept.epochs);
        let (epoch, nll, mse, held_out) = (report.epoch, report.nll, report.mse, self.held_out);
        match epochs.iter_mut().find(|one| one.label == self.label) {
            Some(one) => (one.epoch, one.nll, one.mse, one.held_out) = (epoch, nll, mse, held_out),
            None => epochs.push(Epoch { label: self.label.clone(), epoch, total: self.total, nll, mse, held_out }),
        }
    }

    fn held_out(&mut self, glance: &Glance) {
        self.held_out = glance.one_step.nll.or(Some(glance.one_step.mse));
    }

    fn say(&self, message: &str) {
        locked(&self.kept.said).push(message.to_owned());
    }
}

/// Works in another thread, while this one, which may be the one that gets signals, looks whether a person wants to stop, and hands news
/// on. A wish to stop is passed on; the exception comes back beside the result.
pub fn attended<T: Send>(
    py: Python<'_>,
    (interrupt, news): (&Interrupt, &News),
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<(T, Option<PyErr>)> {
    let mut raised: Option<PyErr> = None;
    let mut delivered = Instant::now();
    let ended = std::thread::scope(|scope| {
        let (done, ends) = sync_channel(1);
        let caught = move || {
            let result = catch_unwind(AssertUnwindSafe(work));
            // Who waits for it is there until it comes.
            _ = done.send(result);
        };
        let begun = std::thread::Builder::new().name("scrnn".to_owned()).stack_size(STACK).spawn_scoped(scope, caught);
        if let Err(error) = begun {
            return Err(raise(Failure::input(format!("no thread can be started: {error}"), "")));
        }
        let ends = Mutex::new(ends);
        loop {
            match py.detach(|| locked(&ends).recv_timeout(BETWEEN_LOOKS)) {
                Ok(Ok(result)) => return result.map_err(raise),
                Ok(Err(panic)) => return Err(raise_panic(panic.as_ref())),
                Err(RecvTimeoutError::Disconnected) => return Err(raise_panic(&"a thread is gone")),
                Err(RecvTimeoutError::Timeout) => {}
            }
            let mut looked = py.check_signals();
            if looked.is_ok() && delivered.elapsed() >= BETWEEN_UPDATES {
                delivered = Instant::now();
                looked = news.deliver(py).map(|stop| {
                    if stop {
                        interrupt.ask();
                    }
                });
            }
            if let Err(error) = looked {
                interrupt.ask();
                raised.get_or_insert(error);
            }
        }
    });
    if let Err(error) = news.deliver(py) {
        raised.get_or_insert(error);
    }
    match (ended, raised) {
        // It may have failed because of the wish.
        (Err(_), Some(raised)) => Err(raised),
        (ended, raised) => Ok((ended?, raised)),
    }
}

/// As [`attended`], where a wish to stop ends nothing but is heard in the end.
pub fn watched<T: Send>(py: Python<'_>, news: &News, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    match attended(py, (&Interrupt::new(), news), work)? {
        (_, Some(raised)) => Err(raised),
        (found, None) => Ok(found),
    }
}

/// As [`compute`], for what has something to say.
pub fn told<T: Send>(py: Python<'_>, news: &News, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    let found = compute(py, work);
    news.deliver(py)?;
    found
}
