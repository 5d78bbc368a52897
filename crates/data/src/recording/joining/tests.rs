//! Series of messages as rows.

use super::*;

fn series(columns: &[usize], times: &[i64], values: &[f64]) -> Series {
    Series { columns: columns.to_vec(), times: times.to_vec(), values: values.to_vec() }
}

fn joined(series: Vec<Series>, discrete: &[bool], period: Option<i64>) -> Result<Joined, String> {
    let names: Vec<String> = (0..discrete.len()).map(|k| format!("n{k}")).collect();
    join(series, Channels { names: &names, discrete }, period, &Budget::of(1 << 20)).map_err(|refusal| match refusal {
        Refusal::Said(said) => said,
        Refusal::Memory(over) => over.to_string(),
    })
}

fn values(series: Vec<Series>, discrete: &[bool], period: Option<i64>) -> Vec<f64> {
    joined(series, discrete, period).unwrap().values
}

#[test]
fn samples_lie_on_the_lines_between_messages() {
    let one = || vec![series(&[0], &[100, 110, 130, 130, 140], &[0., 1., 3., 5., 6.])];
    assert_eq!(values(one(), &[false], Some(10)), [0., 1., 2., 5., 6.]);
    assert_eq!(values(one(), &[false], Some(5)), [0., 0.5, 1., 1.5, 2., 2.5, 5., 5.5, 6.]);
    assert_eq!(values(one(), &[false], Some(15)), [0., 1.5, 5.]);
    assert_eq!(values(one(), &[true], Some(5)), [0., 0., 1., 1., 1., 3., 5., 5., 6.]);
    let two = vec![series(&[0, 1], &[0, 10], &[0., 1., 10., -1.])];
    assert_eq!(values(two, &[false, false], Some(5)), [0., 1., 5., 0., 10., -1.]);
    assert_eq!(values(vec![series(&[0], &[7], &[4.0])], &[false], Some(1)), [4.0]);
    let late = vec![series(&[0], &[i64::MAX - 10, i64::MAX], &[0., 1.])];
    assert_eq!(values(late, &[false], Some(10)), [0., 1.]);
    let missing = values(vec![series(&[0], &[0, 10, 20], &[0., f64::NAN, 2.])], &[false], Some(5));
    assert_eq!(missing.iter().map(|value| value.is_nan()).collect::<Vec<_>>(), [false, true, true, true, false]);
}

#[test]
fn series_are_joined_where_all_are_there_at_the_times_of_the_densest() {
    let fast = series(&[0], &[0, 10, 20, 30, 40, 50], &[0., 1., 2., 3., 4., 5.]);
    let slow = series(&[1], &[2, 34, 66], &[0., 32., 64.]);
    let joined = joined(vec![slow, fast], &[false, false], None).unwrap();
    assert_eq!(joined.values, [1., 8., 2., 18., 3., 28., 4., 38., 5., 48.]);
    assert_eq!((joined.period, joined.cut), (Some(10), 24));
}

#[test]
fn names_that_come_and_go_are_missing_or_bridged() {
    let both = series(&[0, 1], &[0, 10, 20, 30, 50], &[0., 0., 1., 1., 2., 2., 3., 3., 5., 5.]);
    let one = series(&[0], &[40], &[4.]);
    let rows = joined(vec![both.clone(), one.clone()], &[false, false], None).unwrap();
    assert_eq!(rows.times, [0, 10, 20, 30, 40, 50]);
    assert_eq!(rows.values[..8], [0., 0., 1., 1., 2., 2., 3., 3.]);
    assert!(rows.values[9].is_nan() && rows.values[8] == 4.0 && rows.values[10..] == [5., 5.]);
    let bridged = values(vec![both, one], &[false, false], Some(20));
    assert_eq!(bridged, [0., 0., 2., 2., 4., 4.]);
}

#[test]
fn gaps_senseless_periods_and_strangers_in_time_are_refused() {
    let gap = || vec![series(&[0], &[0, 10, 20, 30, 200, 210], &[0.; 6])];
    assert!(joined(gap(), &[false], Some(10)).unwrap_err().contains("between 0.00000003 s and 0.0000002 s"));
    assert!(joined(gap(), &[false], Some(20)).is_ok());
    assert!(joined(gap(), &[true], Some(10)).is_ok(), "what is discrete stays what it is");
    let two = vec![series(&[0], &[0, 1_000_000_000], &[0., 1.])];
    assert!(joined(two, &[false], Some(1)).unwrap_err().contains("would become 1000000001 samples"));
    let ends = vec![series(&[0], &[0, i64::MAX], &[0., 1.])];
    assert!(joined(ends, &[false], Some(1)).unwrap_err().contains("would become"));
    let apart = vec![series(&[0], &[0, 10, 20], &[0.; 3]), series(&[1], &[1000, 1010], &[0.; 2])];
    let said = joined(apart, &[false, false], None).unwrap_err();
    assert_eq!(
        said,
        "the channels are not there at the same time: n0 from 0 s to 0.00000002 s; n1 from 0.000001 s to 0.00000101 s"
    );
    let wide: Vec<i64> = (0..1000).collect();
    let many: Vec<Series> = (0..300).map(|column| series(&[column], &[0, 999], &[0.; 2])).collect();
    let many = [vec![series(&[300], &wide, &[0.0; 1000])], many].concat();
    assert!(joined(many, &[false; 301], None).unwrap_err().contains("memory"));
}
