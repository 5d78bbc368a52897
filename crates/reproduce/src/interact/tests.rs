//! The interaction in short: what is interrupted is kept and gone on with.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use scrnn::dataset::Dataset;
use scrnn::engine::Engine;
use scrnn::initialization::initialize;
use scrnn::scaling::Scaling;
use scrnn_run::interrupt::Interrupt;
use scrnn_run::messages::Silent;
use scrnn_sim::interact::{CHANNELS, InteractionOptions, parse_order, record, samples};

use super::*;
use crate::framework::kept::Kept;
use crate::framework::preset::Preset;
use crate::framework::stop::Stop;

/// One interaction, and how it is scaled.
fn recorded() -> (Dataset, Scaling) {
    let order = parse_order(trials::OTHER).unwrap();
    let sequence = record(&order, &InteractionOptions::default(), (1, 0), samples(&order), |_, _| {}).unwrap();
    let data = Dataset::new(CHANNELS.map(String::from).to_vec(), vec![sequence]).unwrap();
    let scaling = Scaling::fit(&data, Scaling::RANGE);
    (scaling.apply(&data).unwrap(), scaling)
}

#[test]
fn an_interrupted_evaluation_ends_soon_and_goes_on_where_it_was() {
    let (data, scaling) = recorded();
    let wide = &conditions::WIDE;
    let experiment = wide.condition.networks[0].experiment(Preset::Fast, 1, None, &[]).unwrap();
    let (network, states) = initialize(&experiment.bare_topology(CHANNELS.len()).unwrap(), 1, 1);
    let (study, engine) = (Interact { trials: 1, scanned: 2 }, Engine::serial());
    let folder = tempfile::tempdir().unwrap();
    let asked = Mutex::new(None::<Instant>);
    let evaluate = |interrupt: &Interrupt, kept: Kept| {
        let desk = Desk::new(&engine, (interrupt, &Silent), "", Some(kept));
        let subject =
            Subject { network: &network, states: &states, scaling: &scaling, data: &data, seed: 1, desk: &desk };
        let found = Findings::of(wide, &subject, &study).map(|found| serde_json::to_string(&found).unwrap());
        (found, desk.saved())
    };
    let place = folder.path().join("whole");
    std::fs::create_dir(&place).unwrap();
    let (whole, saved) = evaluate(&Interrupt::new(), Kept::open(&place, "a".into()));
    assert_eq!(saved, 0.0);

    // Somebody asks to stop as soon as error regression in the world is the next part.
    let place = folder.path().join("cut");
    std::fs::create_dir(&place).unwrap();
    let interrupt = Interrupt::new();
    let before_the_last = || {
        let text = std::fs::read_to_string(place.join("evaluation.toml")).unwrap_or_default();
        text.contains("without the arm")
    };
    let cut = std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            while !before_the_last() {
                std::thread::sleep(Duration::from_millis(5));
            }
            interrupt.ask();
            *asked.lock().unwrap() = Some(Instant::now());
        });
        let cut = evaluate(&interrupt, Kept::open(&place, "a".into())).0;
        watch.join().unwrap();
        cut
    });
    assert!(matches!(cut, Err(Stop::Interrupted)));
    let waited = asked.into_inner().unwrap().unwrap().elapsed();
    assert!(waited < Duration::from_secs(3), "{waited:?}");

    let (again, saved) = evaluate(&Interrupt::new(), Kept::open(&place, "a".into()));
    assert!(saved > 0.0);
    let without_times = |text: Result<String>| {
        let mut value: serde_json::Value = serde_json::from_str(&text.ok().unwrap()).unwrap();
        for what in ["default", "thesis", "without_arm"] {
            value["regression"][what].as_object_mut().unwrap().remove("milliseconds");
        }
        value
    };
    assert_eq!(without_times(again), without_times(whole));
}
