//! Shows what a data file holds.
//!
//! ```console
//! cargo run -p scrnn-data --example show -- mine.csv
//! ```

use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "crates/data/examples/arm.csv".to_owned());
    let data = scrnn_data::read(Path::new(&name))?;
    println!("{name}: {} sequences on {}", data.sequences().len(), data.channels().join(", "));
    for sequence in data.sequences() {
        println!("  {}: {} samples, the first is {:?}", sequence.name, sequence.len(), sequence.sample(0));
    }
    Ok(())
}
