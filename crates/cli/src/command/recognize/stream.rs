//! Samples that come line by line while they are made.

use std::io::BufRead;
use std::path::Path;

use scrnn_run::failure::{Failure, Result};

/// Columns that are no channels.
const NOT_CHANNELS: [&str; 3] = ["sequence", "step", "time"];

/// Lines of numbers between commas, semicolons, tabs or spaces. A first line with names may put the channels in any order; a
/// blank line ends a sequence.
#[derive(Debug)]
pub struct Stream<R> {
    input: R,
    channels: Vec<String>,
    /// Which field each channel stands in.
    fields: Option<Vec<usize>>,
    number: usize,
    line: String,
}

/// What came.
#[derive(Debug, PartialEq)]
pub enum Arrival {
    /// One value for each channel.
    Sample(Vec<f64>),
    /// A sequence ended.
    Gap,
}

impl<R: BufRead> Stream<R> {
    /// Of samples on these channels.
    pub fn new(input: R, channels: &[String]) -> Self {
        Self { input, channels: channels.to_vec(), fields: None, number: 0, line: String::new() }
    }

    /// Waits for the next sample; none at the end of the stream.
    pub fn next(&mut self) -> Result<Option<Arrival>> {
        loop {
            self.line.clear();
            let read = self.input.read_line(&mut self.line);
            if read.map_err(|error| Failure::disk("read", Path::new("the stream"), error))? == 0 {
                return Ok(None);
            }
            self.number += 1;
            let line = self.line.trim();
            if line.is_empty() {
                return Ok(Some(Arrival::Gap));
            }
            if line.starts_with('#') {
                continue;
            }
            let split = |c: char| c == ',' || c == ';' || c.is_whitespace();
            let cells: Vec<&str> = line.split(split).map(str::trim).filter(|cell| !cell.is_empty()).collect();
            if self.fields.is_none() {
                let named = cells.iter().any(|cell| cell.parse::<f64>().is_err());
                self.fields = Some(if named { self.header(&cells)? } else { (0..self.channels.len()).collect() });
                if named {
                    continue;
                }
            }
            return self.sample(&cells).map(|sample| Some(Arrival::Sample(sample)));
        }
    }

    /// Where the names of the first line put the channels.
    fn header(&self, names: &[&str]) -> Result<Vec<usize>> {
        let found = |name: &String| names.iter().position(|cell| cell == name);
        if let Some(fields) = self.channels.iter().map(found).collect() {
            return Ok(fields);
        }
        let others: Vec<usize> = (0..names.len()).filter(|&k| !NOT_CHANNELS.contains(&names[k])).collect();
        match others.len() == self.channels.len() {
            true => Ok(others),
            false => Err(Failure::input(
                format!("line {} names the channels {}", self.number, names.join(", ")),
                format!("the network learned {}", self.channels.join(", ")),
            )),
        }
    }

    fn sample(&self, cells: &[&str]) -> Result<Vec<f64>> {
        let fields = self.fields.as_deref().unwrap_or_default();
        let needed = || format!("the network needs {} numbers: {}", self.channels.len(), self.channels.join(", "));
        let value = |(&field, channel): (&usize, &String)| {
            let Some(cell) = cells.get(field) else {
                let message = format!("line {} has {} fields, none for {channel}", self.number, cells.len());
                return Err(Failure::input(message, needed()));
            };
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(Failure::input(format!("line {}, {channel} is `{cell}`", self.number), "a finite number")),
            }
        };
        fields.iter().zip(&self.channels).map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Result<Vec<Arrival>> {
        let mut stream = Stream::new(text.as_bytes(), &["a".to_owned(), "b".to_owned()]);
        std::iter::from_fn(|| stream.next().transpose()).collect()
    }

    #[test]
    fn channels_are_found_by_name_or_place() {
        let samples = [Arrival::Sample(vec![1.0, 2.0]), Arrival::Gap, Arrival::Sample(vec![3.0, 4.0])];
        for text in
            ["1,2\n\n3,4\n", "# noise\na,b\n1,2\n\n3 4", "time;b;a\n0;2;1\n\n1;4;3\n", "step\tx\ty\n1\t1\t2\n\n2\t3\t4"]
        {
            assert_eq!(all(text).unwrap(), samples, "{text:?}");
        }
    }

    #[test]
    fn a_bad_line_is_named_by_number_and_channel() {
        for (text, message) in [
            ("1,2\n3\n", "line 2 has 1 fields, none for b"),
            ("1,2\n3,x\n", "line 2, b is `x`"),
            ("1,2\nNaN,1\n", "line 2, a is `NaN`"),
            ("p,q,r\n1,2,3\n", "line 1 names the channels p, q, r"),
        ] {
            assert_eq!(all(text).unwrap_err().to_string(), message);
        }
    }
}
