//! SQLite files: a bag that another program wrote, and the same damaged.

use std::io::Cursor;

use super::*;
use crate::recording::ros::Dice;

const BAG: &[u8] = include_bytes!("../../../tests/cases/14-cdr-jointstate/bag3/bag3.db3");

type Rows = Vec<(i64, i64, i64, usize)>;

fn messages(bytes: &[u8]) -> Result<Rows, Problem> {
    let mut rows = Vec::new();
    let mut database = Database::open(Cursor::new(bytes))?;
    let there = database.rows("messages", &["id", "topic_id", "timestamp", "data"], &mut |row| {
        if let [Value::Whole(id), Value::Whole(topic), Value::Whole(time), Value::Bytes(data)] = row {
            rows.push((*id, *topic, *time, data.len()));
        }
        Ok::<(), Problem>(())
    })?;
    assert!(there || bytes != BAG);
    Ok(rows)
}

#[test]
fn the_rows_of_a_bag_are_read_in_order() {
    let rows = messages(BAG).unwrap();
    let expected: Rows = (0..30).map(|k| (k + 1, 1, 1_766_147_454_233_218_075 + 20_000_000 * k, 84)).collect();
    assert_eq!(rows, expected);
    let mut database = Database::open(Cursor::new(BAG)).unwrap();
    let mut topics = Vec::new();
    let each = &mut |row: &[Value<'_>]| {
        topics.push(format!("{row:?}"));
        Ok::<(), Problem>(())
    };
    assert!(database.rows("topics", &["NAME", "type"], each).unwrap());
    assert_eq!(topics.len(), 1);
    assert!(!database.rows("topics", &["colour"], &mut |_| Ok::<(), Problem>(())).unwrap());
    assert!(!database.rows("tropics", &[], &mut |_| Ok::<(), Problem>(())).unwrap());
}

#[test]
fn a_damaged_database_ends() {
    assert!(matches!(messages(b"y1,y2"), Err(Problem::Wrong(_))));
    let mut dice = Dice(11);
    let mut refused = 0;
    for _ in 0..3000 {
        let mut damaged = BAG.to_vec();
        for _ in 0..=dice.roll(8) {
            let at = dice.roll(damaged.len());
            damaged[at] = dice.roll(256) as u8;
        }
        refused += usize::from(messages(&damaged).is_err());
        refused += usize::from(messages(&damaged[..dice.roll(BAG.len())]).is_err());
    }
    assert!(refused > 1000, "{refused}");
}

#[test]
fn pages_in_a_circle_and_rows_that_share_pages_end() {
    // The root of `messages` becomes an inner page that leads to itself.
    let database = Database::open(Cursor::new(BAG)).unwrap();
    let root = database.tables.iter().find(|table| table.name == "messages").unwrap().root;
    let at = (root as usize - 1) * database.pages.usable() as usize;
    let mut circle = BAG.to_vec();
    circle[at] = 5;
    circle[at + 3..at + 5].copy_from_slice(&[0, 0]);
    circle[at + 8..at + 12].copy_from_slice(&root.to_be_bytes());
    assert!(matches!(messages(&circle), Err(Problem::Wrong(said)) if said.contains("circle")));
}

#[test]
fn columns_are_named_by_the_statement_that_made_the_table() {
    let sql = "CREATE TABLE messages(id INTEGER PRIMARY KEY, \"topic_id\" INTEGER NOT NULL CHECK (a, b), data BLOB, PRIMARY KEY(id))";
    assert_eq!(columns(sql), (vec!["id".into(), "topic_id".into(), "data".into()], Some(0)));
    assert_eq!(columns("CREATE TABLE x(a TEXT PRIMARY KEY, b INTEGER)"), (vec!["a".into(), "b".into()], None));
    assert_eq!(columns("nothing"), (vec![], None));
}
