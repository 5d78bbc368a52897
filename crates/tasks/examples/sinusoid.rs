//! The noisy sine wave of chapter 3, with the true mean and standard deviation beside each sample.
//!
//! ```console
//! cargo run -p scrnn-tasks --example sinusoid
//! ```

use scrnn_tasks::{TaskName, make};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let task = make(TaskName::Sinusoid, (1, 25), 1, 1)?;
    println!("step  sample   mean     sd");
    for step in 0..25 {
        let of = |data: &scrnn::Dataset| data.sequences()[0].sample(step)[0];
        let sd = of(&task.variances).sqrt();
        println!("{:4}  {:7.4}  {:7.4}  {sd:.4}", step + 1, of(&task.data), of(&task.means));
    }
    Ok(())
}
