//! What figures of several studies are made from.

use scrnn::dataset::Dataset;
use scrnn::generation::Generated;
use scrnn_report::{Block, Drawing, Figure};

/// A figure as a block.
pub fn figure(file: &str, title: &str, caption: &str, thesis: &str, drawing: impl Into<Drawing>) -> Block {
    let [file, title, caption, thesis] = [file, title, caption, thesis].map(str::to_owned);
    Block::Figure(Box::new(Figure { file, title, caption, thesis, drawing: drawing.into() }))
}

/// The two units whose activations vary most while they do not vary alike.
pub fn two_units(generated: &[Generated], units: usize) -> Option<(usize, usize)> {
    let column = |i: usize| -> Vec<f64> {
        generated.iter().flat_map(|one| one.contexts.iter().skip(i).step_by(units)).copied().collect()
    };
    let columns: Vec<Vec<f64>> = (0..units).map(column).collect();
    let spread = |i: usize| scrnn::evaluation::mean_and_deviation(&columns[i]).1;
    let first = (0..units).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).filter(|&i| columns[i].len() > 1)?;
    let alike = |i: usize| scrnn::evaluation::correlation(&columns[first], &columns[i]).map_or(1.0, f64::abs);
    let worth = |i: usize| spread(i) * (1.0 - alike(i));
    let second = (0..units).filter(|&i| i != first).max_by(|&a, &b| worth(a).total_cmp(&worth(b)))?;
    Some((first, second))
}

/// Channel `i` of a sequence over its steps.
pub fn over_time(data: &Dataset, s: usize, i: usize, steps: usize) -> Vec<(f64, f64)> {
    let sequence = &data.sequences()[s];
    (0..steps.min(sequence.len())).map(|k| ((k + 1) as f64, sequence.sample(k)[i])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_units_that_move_most_and_not_alike_are_chosen() {
        let contexts = (0..50)
            .flat_map(|k| {
                let angle = f64::from(k);
                [0.1 * angle.cos(), 0.9 * angle.sin(), 0.8 * angle.sin(), 0.5 * angle.cos()]
            })
            .collect();
        let generated = {
            let mut it = Generated::default();
            it.contexts = contexts;
            it
        };
        assert_eq!(two_units(&[generated], 4), Some((1, 3)));
        assert_eq!(two_units(&[Generated::default()], 4), None);
    }
}
