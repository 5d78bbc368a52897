//! SQLite files, as far as bags need them: the rows of a table in the order of their numbers. Nothing is ever written.
//!
//! ```text
//! file       pages of one size, numbered from 1; the first begins with a header of 100 bytes
//! table      a tree of pages: inner ones (5) lead to others, leaves (13) hold rows
//! row        size, number (varints), the first bytes of its values, the page where they go on
//! values     a header of varints that tell each value's type and length, then the values
//! ```

mod pages;
mod rows;

use std::io::{Read, Seek};

use pages::Pages;
use rows::Cells;

pub use rows::Value;

/// Most tables, and most columns of one.
const MOST: usize = 4096;

/// What stands in the way of reading.
#[derive(Debug)]
pub enum Problem {
    /// The file is not what it should be, as a sentence's end.
    Wrong(String),
    /// The operating system refused.
    Disk(std::io::Error),
}

impl From<std::io::Error> for Problem {
    fn from(error: std::io::Error) -> Self {
        Self::Disk(error)
    }
}

fn damaged(what: &str) -> Problem {
    Problem::Wrong(format!("the database is damaged: {what}"))
}

/// What is done with each row: its number, and its values.
type EachRow<'e, E> = dyn FnMut(i64, &[Value<'_>]) -> Result<(), E> + 'e;

/// A table and its columns.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Table {
    name: String,
    root: u32,
    columns: Vec<String>,
    /// The column that is the row's number, and stands in no row.
    number: Option<usize>,
}

/// A database.
pub struct Database<R> {
    pages: Pages<R>,
    tables: Vec<Table>,
}

impl<R: Read + Seek> Database<R> {
    /// Reads the header and what tables there are.
    ///
    /// # Errors
    /// [`Problem`].
    pub fn open(reader: R) -> Result<Self, Problem> {
        let mut database = Self { pages: Pages::open(reader)?, tables: Vec::new() };
        let mut tables = Vec::new();
        // The table of tables: type, name, table's name, first page, the statement that made it.
        database.walk(1, &mut |_, values| {
            let [kind, name, _, root, sql, ..] = values else { return Ok(()) };
            let (Value::Text(kind), Value::Text(name)) = (kind, name) else { return Ok(()) };
            if *kind != b"table" {
                return Ok(());
            }
            if tables.len() == MOST {
                return Err(damaged("it has more than 4096 tables"));
            }
            let (Value::Whole(root), Value::Text(sql)) = (root, sql) else { return Ok(()) };
            let root = u32::try_from(*root).map_err(|_| damaged("a table begins nowhere"))?;
            let (columns, number) = columns(&String::from_utf8_lossy(sql));
            tables.push(Table { name: String::from_utf8_lossy(name).into_owned(), root, columns, number });
            Ok(())
        })?;
        database.tables = tables;
        Ok(database)
    }

    /// Calls `each` with these columns of each row of a table. Without the table, or one of the columns: false.
    ///
    /// # Errors
    /// [`Problem`], or what `each` says.
    pub fn rows<E: From<Problem>>(
        &mut self,
        table: &str,
        columns: &[&str],
        each: &mut dyn FnMut(&[Value<'_>]) -> Result<(), E>,
    ) -> Result<bool, E> {
        let Some(table) = self.tables.iter().find(|found| found.name == table).cloned() else { return Ok(false) };
        let place = |name: &&str| table.columns.iter().position(|column| column.eq_ignore_ascii_case(name));
        let Some(places) = columns.iter().map(place).collect::<Option<Vec<_>>>() else { return Ok(false) };
        self.walk(table.root, &mut |number, values| {
            let wanted = places.iter().map(|&place| match values.get(place) {
                _ if table.number == Some(place) => Value::Whole(number),
                Some(value) => *value,
                None => Value::Null,
            });
            each(&wanted.collect::<Vec<_>>())
        })?;
        Ok(true)
    }

    /// Calls `each` with the number and values of each row of the tree at `root`.
    fn walk<E: From<Problem>>(&mut self, root: u32, each: &mut EachRow<'_, E>) -> Result<(), E> {
        let mut visits = self.pages.count();
        let mut overflows = u64::from(self.pages.count());
        let mut waiting = vec![root];
        let (mut page, mut row) = (Vec::new(), Vec::new());
        while let Some(number) = waiting.pop() {
            // Each page is met once; a tree that bites its tail would never end.
            visits = visits.checked_sub(1).ok_or_else(|| damaged("its pages form a circle"))?;
            self.pages.read(number, &mut page)?;
            let cells = Cells::of(&page, number)?;
            if cells.is_inner() {
                let children = cells.children().collect::<Result<Vec<_>, _>>()?;
                waiting.extend(children.into_iter().rev());
                if waiting.len() > self.pages.count() as usize {
                    return Err(damaged("it has more ways than pages").into());
                }
                continue;
            }
            let mut room = page.len();
            for cell in cells.rows(self.pages.usable()) {
                let cell = cell?;
                room = room.checked_sub(cell.here.len()).ok_or_else(|| damaged("rows stand on each other"))?;
                if cell.size > self.pages.bytes() {
                    return Err(damaged("a row is larger than the file").into());
                }
                row.clear();
                row.extend_from_slice(cell.here);
                let mut next = cell.overflow;
                let mut rest = cell.size - cell.here.len() as u64;
                while rest > 0 {
                    overflows = overflows.checked_sub(1).ok_or_else(|| damaged("its rows share pages"))?;
                    (next, rest) = self.pages.append(next, rest, &mut row)?;
                }
                let values = rows::values(&row).ok_or_else(|| damaged("a row's values do not fit into it"))?;
                each(cell.number, &values)?;
            }
        }
        Ok(())
    }
}

/// The columns' names in the statement that made the table, and which is the row's number.
fn columns(sql: &str) -> (Vec<String>, Option<usize>) {
    let Some((_, inside)) = sql.split_once('(') else { return (Vec::new(), None) };
    let (mut columns, mut number) = (Vec::new(), None);
    for part in parts(inside) {
        let name = part.split_whitespace().next().unwrap_or_default();
        let upper = part.to_ascii_uppercase();
        let first = upper.split_whitespace().next().unwrap_or_default();
        if ["CONSTRAINT", "PRIMARY", "UNIQUE", "CHECK", "FOREIGN"]
            .contains(&first.split('(').next().unwrap_or_default())
        {
            continue;
        }
        let words: Vec<&str> = upper.split_whitespace().collect();
        if words.get(1) == Some(&"INTEGER") && upper.contains("PRIMARY KEY") {
            number = Some(columns.len());
        }
        if columns.len() < MOST {
            columns.push(name.trim_matches(['"', '`', '[', ']', '\'']).to_owned());
        }
    }
    (columns, number)
}

/// Splits at commas that stand outside of brackets, up to the closing one.
fn parts(text: &str) -> Vec<&str> {
    let (mut parts, mut depth, mut start) = (Vec::new(), 0_usize, 0);
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' if depth == 0 => {
                parts.push(text[start..at].trim());
                return parts;
            }
            ')' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    parts
}

#[cfg(test)]
mod tests;
