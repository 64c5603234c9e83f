//! Rows of Structured Text for the table of `hydroboom export closed-loop --csv`: the blocks are evaluated on the
//! virtual crane. The rows are appended to the given file, if any.
//!
//! ```sh
//! hydroboom export closed-loop --csv table.csv
//! cargo run --release -p hydroboom-export --example structured_text_closed_loop -- table.csv
//! ```

#![expect(clippy::unwrap_used, reason = "an example that cannot set up has failed")]
#![allow(dead_code, reason = "the tests use more of what it shares with them")]

#[path = "../tests/integration/evaluator/mod.rs"]
mod evaluator;
#[path = "../tests/integration/on_plc/mod.rs"]
mod on_plc;

use hydroboom_description::Description;
use hydroboom_export::closed_loop::{HEADER, csv};
use std::io::Write;

/// Number of disturbed inputs, from the piston position on.
const INPUTS: usize = 6;

fn main() -> std::io::Result<()> {
    let model = Description::uia_single_boom().unwrap();
    let machine = Description::uia_virtual().unwrap();
    let rows = on_plc::rows(&model, &machine, INPUTS);
    match std::env::args().nth(1) {
        Some(path) => {
            let mut file = std::fs::OpenOptions::new().append(true).open(path)?;
            file.write_all(csv(&rows, false).as_bytes())
        }
        None => {
            println!("{}", HEADER.join(" | "));
            rows.iter().for_each(|row| println!("{}", row.cells().join(" | ")));
            Ok(())
        }
    }
}
