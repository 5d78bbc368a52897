//! Demonstrations: precise where it matters, free where it does not.

use super::*;
use crate::reach::touching::spread;

fn few(placement: f64, threads: usize) -> Vec<Demonstration> {
    let tutoring = Tutoring { sequences: 3, samples: 60, placement, ..Tutoring::default() };
    demonstrate(&tutoring, 4, threads).unwrap()
}

#[test]
fn every_touch_is_one_and_retractions_vary() {
    let demonstrations = few(0.01, 2);
    let mut touches = Vec::new();
    for (index, one) in demonstrations.iter().enumerate() {
        assert_eq!((one.position, one.cycles.len(), one.samples.len()), (index, 5, 60 * 6));
        assert!((one.y - POSITIONS[index]).abs() <= 0.01 && one.y != POSITIONS[index]);
        assert!(one.cycles.iter().all(|cycle| cycle.touched && cycle.touch.gap < 0.001), "{:?}", one.cycles);
        assert!(one.cycles.iter().all(|cycle| cycle.retracted));
        let at = |moment: fn(&Cycle) -> Option<[f64; 3]>| {
            let points: Vec<[f64; 3]> = one.cycles.iter().filter_map(moment).collect();
            spread(&points).unwrap()
        };
        let touch = at(|cycle| Some(cycle.touch.hand));
        let retraction = at(|cycle| cycle.retraction.map(|moment| moment.hand));
        assert!(touch < 0.005 && retraction > 0.015, "{touch} {retraction}");
        touches.extend(one.cycles.iter().map(|cycle| cycle.touch.time));
    }
    // The metronome beats every 6 s, from 3 s on.
    for (k, time) in touches.iter().enumerate() {
        let expected = 3.0 + 6.0 * (k % 5) as f64;
        assert!((time - expected).abs() < 0.8, "touch {k} at {time} s");
    }
}

#[test]
fn seed_and_placement_decide_and_threads_do_not() {
    let one = few(0.01, 1);
    assert_eq!(one, few(0.01, 3));
    let exact = few(0.0, 3);
    assert!(exact.iter().zip(POSITIONS).all(|(one, y)| one.y == y));
    assert_ne!(one, exact);
    let other = demonstrate(&Tutoring { sequences: 1, samples: 60, ..Tutoring::default() }, 5, 1).unwrap();
    assert_ne!(one[0], other[0]);
}

#[test]
fn a_demonstration_does_not_depend_on_how_many_there_are() {
    let alone = demonstrate(&Tutoring { sequences: 1, samples: 60, ..Tutoring::default() }, 4, 1).unwrap();
    assert_eq!(alone[0], few(0.01, 1)[0]);
    let data = dataset(&few(0.01, 1)).unwrap();
    assert_eq!(data.channels(), REACHING);
    let names: Vec<&str> = data.sequences().iter().map(|sequence| sequence.name.as_str()).collect();
    assert_eq!(names, ["1-01", "2-01", "3-01"]);
}

#[test]
fn nothing_to_demonstrate_is_refused() {
    let refuse = |tutoring: Tutoring| demonstrate(&tutoring, 1, 1).unwrap_err().to_string();
    assert!(refuse(Tutoring { sequences: 0, ..Tutoring::default() }).contains("demonstrations is 0"));
    assert!(refuse(Tutoring { samples: 0, ..Tutoring::default() }).contains("needed: at least 1"));
    assert!(refuse(Tutoring { placement: 0.3, ..Tutoring::default() }).contains("0.3 m; needed: 0 to 0.02 m"));
}
