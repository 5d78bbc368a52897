//! What looks wrong in data must not be found in good ones.

use scrnn_data::suspicions::look;
use scrnn_tasks::{limit_cycle, lissajous, patterns, sinusoid};

#[test]
fn the_thesis_data_raise_no_suspicion() {
    let tasks = [
        lissajous::generate(&lissajous::Options::default(), 1).unwrap().data,
        patterns::generate(&patterns::Options::default(), 1).unwrap().data,
        sinusoid::generate(&sinusoid::Options::default(), 1).unwrap().data,
        limit_cycle::generate(&limit_cycle::Options::default(), 1).unwrap().task.data,
    ];
    for data in tasks {
        assert_eq!(look(&data), [], "{:?}", data.channels());
    }
}
