//! A study's own tables: defined once, shown on the page and written to metrics.json.

use scrnn_report::Sheet;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

/// A column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Its key in metrics.json.
    pub key: &'static str,
    /// Its head on the page.
    pub label: &'static str,
    /// Digits behind the point of numbers.
    pub digits: usize,
}

/// What stands in a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A count.
    Count(u64),
    /// A number.
    Number(f64),
    /// Several numbers.
    Numbers(Vec<f64>),
}

/// A table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Its key in metrics.json.
    pub key: &'static str,
    /// Stands above it.
    pub caption: &'static str,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its rows, each with a cell for each column.
    pub rows: Vec<Vec<Cell>>,
    /// Stands below it; may be empty.
    pub note: &'static str,
}

impl Table {
    /// For a page.
    pub fn sheet(&self) -> Sheet {
        let shown = |(column, cell): (&Column, &Cell)| match cell {
            Cell::Text(text) => text.clone(),
            Cell::Count(count) => count.to_string(),
            Cell::Number(number) => format!("{number:.*}", column.digits),
            Cell::Numbers(numbers) => {
                numbers.iter().map(|number| format!("{number:.*}", column.digits)).collect::<Vec<_>>().join(" ")
            }
        };
        Sheet {
            caption: self.caption.to_owned(),
            head: self.columns.iter().map(|column| column.label.to_owned()).collect(),
            rows: self.rows.iter().map(|row| self.columns.iter().zip(row).map(shown).collect()).collect(),
            note: self.note.to_owned(),
        }
    }
}

/// A row as metrics.json has it: cells under the keys of their columns.
struct Row<'a>(&'a [Column], &'a [Cell]);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|column| column.key).zip(self.1))
    }
}

/// Tables as metrics.json has them: lists of rows under their keys.
pub fn by_key<S: Serializer>(tables: &[Table], serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(tables.len()))?;
    for table in tables {
        let rows: Vec<Row<'_>> = table.rows.iter().map(|row| Row(&table.columns, row)).collect();
        map.serialize_entry(table.key, &rows)?;
    }
    map.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_the_same_on_the_page_and_in_the_file() {
        let column = |key, label, digits| Column { key, label, digits };
        let table = Table {
            key: "scan",
            caption: "A scan",
            columns: vec![column("setting", "which", 0), column("mean", "mean", 2), column("values", "each", 1)],
            rows: vec![vec![Cell::Text("default".into()), Cell::Number(5.789), Cell::Numbers(vec![1.0, 2.25])]],
            note: "",
        };
        assert_eq!(table.sheet().rows, [["default", "5.79", "1.0 2.2"]]);
        let mut text = Vec::new();
        by_key(&[table], &mut serde_json::Serializer::new(&mut text)).unwrap();
        let expected = r#"{"scan":[{"setting":"default","mean":5.789,"values":[1.0,2.25]}]}"#;
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }
}
