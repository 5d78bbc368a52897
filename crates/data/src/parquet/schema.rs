//! The columns of a parquet file: a tree, flattened in the file, whose leaves hold the values.

use super::damaged;
use super::thrift::Value;
use crate::budget::Budget;
use crate::problem::FormatProblem;

/// Groups in groups that are followed.
const DEEPEST: usize = 16;

/// How the values of a leaf lie in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Physical {
    /// One bit.
    Boolean,
    /// Four bytes.
    Int32,
    /// Eight bytes.
    Int64,
    /// A float of four bytes.
    Float,
    /// A float of eight bytes.
    Double,
    /// A float of two bytes.
    Half,
    /// Text, pictures, decimals: no numbers.
    Other,
}

/// A column that holds values.
#[derive(Debug, Clone, PartialEq)]
pub struct Leaf {
    /// Its path with dots. The two inner levels of a list are left out.
    pub name: String,
    /// How its values lie in the file.
    pub physical: Physical,
    /// Whether its whole numbers have no sign.
    pub unsigned: bool,
    /// Its values in one second, if they are times.
    pub per_second: Option<f64>,
    /// How many lists it is within.
    pub lists: u32,
    /// How many of its levels may be empty: the definition level of a value that is there.
    pub optional: u32,
    /// The definition level from which on an element of the innermost list is there, though it may be missing.
    pub inner: u32,
}

impl Leaf {
    /// Whether it holds numbers.
    #[must_use]
    pub fn is_numeric(&self) -> bool {
        self.physical != Physical::Other
    }
}

/// The leaves of the tree that the footer describes.
pub fn leaves(elements: &[Value<'_>], budget: &Budget) -> Result<Vec<Leaf>, FormatProblem> {
    let broken = || damaged("the description of its columns");
    let (root, mut rest) = elements.split_first().ok_or_else(broken)?;
    let mut leaves = Vec::new();
    for _ in 0..root.size(5).unwrap_or(0) {
        let above = Above { path: &[], lists: 0, optional: 0, inner: 0 };
        rest = below(rest, &above, DEEPEST, budget, &mut leaves)?;
    }
    if rest.is_empty() { Ok(leaves) } else { Err(broken()) }
}

/// What is known of the levels above an element.
struct Above<'a> {
    path: &'a [&'a str],
    lists: u32,
    optional: u32,
    inner: u32,
}

/// Reads one element and what is below it; the elements behind them.
fn below<'a, 'b>(
    elements: &'b [Value<'a>],
    above: &Above<'_>,
    deeper: usize,
    budget: &Budget,
    leaves: &mut Vec<Leaf>,
) -> Result<&'b [Value<'a>], FormatProblem> {
    let broken = || damaged("the description of its columns");
    let (element, mut rest) = elements.split_first().ok_or_else(broken)?;
    let deeper = deeper.checked_sub(1).ok_or_else(broken)?;
    let name = element.text(4).ok_or_else(broken)?;
    let repetition = element.int(3).unwrap_or(0);
    let (lists, optional) = (above.lists + u32::from(repetition == 2), above.optional + u32::from(repetition != 0));
    let inner = if repetition == 2 { optional } else { above.inner };
    let path: Vec<&str> = above.path.iter().copied().chain([name]).collect();
    let children = element.size(5).unwrap_or(0);
    if children > 0 {
        for _ in 0..children {
            rest = below(rest, &Above { path: &path, lists, optional, inner }, deeper, budget, leaves)?;
        }
        return Ok(rest);
    }
    budget.take(size_of::<Leaf>())?;
    let name = budget.text(&without_list_levels(&path).join("."))?;
    let converted = element.int(6);
    let logical = element.field(10);
    let decimal = converted == Some(5) || logical.is_some_and(|logical| logical.field(5).is_some());
    let physical = match (element.int(1), element.int(2)) {
        _ if decimal => Physical::Other,
        (Some(0), _) => Physical::Boolean,
        (Some(1), _) => Physical::Int32,
        (Some(2), _) => Physical::Int64,
        (Some(4), _) => Physical::Float,
        (Some(5), _) => Physical::Double,
        (Some(7), Some(2)) if logical.is_some_and(|logical| logical.field(15).is_some()) => Physical::Half,
        _ => Physical::Other,
    };
    let integer = logical.and_then(|logical| logical.field(10));
    let unsigned = match integer.and_then(|integer| integer.field(2)) {
        Some(Value::Bool(signed)) => !signed,
        _ => matches!(converted, Some(11..=14)),
    };
    // A time of day (7) or a date and time (8), and its unit.
    let time = logical.and_then(|logical| logical.field(8).or_else(|| logical.field(7)));
    let per_second = match (time.and_then(|time| time.field(2)), converted) {
        (Some(unit), _) if unit.field(1).is_some() => Some(1e3),
        (Some(unit), _) if unit.field(2).is_some() => Some(1e6),
        (Some(unit), _) if unit.field(3).is_some() => Some(1e9),
        (_, Some(7 | 9)) => Some(1e3),
        (_, Some(8 | 10)) => Some(1e6),
        _ => None,
    };
    leaves.push(Leaf { name, physical, unsigned, per_second, lists, optional, inner });
    Ok(rest)
}

/// A path without the levels that every list has: `list.element`, or `list.item` and `bag.array_element` of old writers.
fn without_list_levels<'a>(path: &[&'a str]) -> Vec<&'a str> {
    let mut kept: Vec<&str> = Vec::with_capacity(path.len());
    let mut at = 0;
    while at < path.len() {
        if at > 0 && matches!(path[at..], ["list", "element" | "item", ..] | ["bag", "array_element", ..]) {
            at += 2;
        } else {
            kept.push(path[at]);
            at += 1;
        }
    }
    kept
}
