//! Markdown table of CSV files of `true_errors`. Each controller is compared with the benchmark controller
//! on the same cranes: `error_table FILE...`.

use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::error_table::ErrorTable;

fn table(files: &[String]) -> Result<String, LabError> {
    let mut table = ErrorTable::default();
    for file in files {
        let content = std::fs::File::open(file)
            .map_err(|e| LabError::Input { file: file.clone(), reason: e.to_string() })?;
        table.read(file, content)?;
    }
    table.markdown()
}

fn main() {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        eprintln!("error_table FILE...");
        std::process::exit(2);
    }
    match table(&files) {
        Ok(table) => print!("{table}"),
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    }
}
